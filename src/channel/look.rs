//! What is on a bus: lists, packets, rates.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use serde::Serialize;
use tactnet_channel::{Bus, ChannelId, Domain, Priority, Table, Wait, now_ns};
use tactnet_serving::percentile;

use super::TableArgs;
use crate::output;
use crate::stop::Stop;

const LOOK: Wait = Wait::Block {
    timeout: Duration::from_millis(100),
};

#[derive(Args)]
pub struct ListArgs {
    #[command(flatten)]
    table: TableArgs,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct ListedChannel<'a> {
    id: &'a str,
    packet: &'a str,
    packet_bytes: usize,
    put_ports: usize,
    put_ports_most: usize,
    get_ports: usize,
    get_ports_most: usize,
    /// Shared memory of a put-port, bytes.
    put_port_bytes: u64,
    distributed: bool,
}

pub fn list(arguments: &ListArgs) -> anyhow::Result<ExitCode> {
    let table = Table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let states = bus.states()?;
    let listed: Vec<ListedChannel<'_>> = table
        .channels
        .iter()
        .zip(&states)
        .map(|((id, channel), state)| ListedChannel {
            id,
            packet: &channel.packet,
            packet_bytes: channel.packet_bytes(),
            put_ports: state.put_ports,
            put_ports_most: channel.put_ports,
            get_ports: state.get_ports,
            get_ports_most: channel.get_ports,
            put_port_bytes: channel.put_port_bytes(),
            distributed: channel.distributed,
        })
        .collect();
    if arguments.json {
        output::print_json(&listed)?;
        return Ok(ExitCode::SUCCESS);
    }
    output::print(format_args!(
        "{:<24} {:<16} {:>12} {:>8} {:>8} {:>16}",
        "channel", "packet", "bytes", "putting", "getting", "memory of a put"
    ))?;
    for channel in listed {
        output::print(format_args!(
            "{:<24} {:<16} {:>12} {:>8} {:>8} {:>16}{}",
            channel.id,
            channel.packet,
            channel.packet_bytes,
            format!("{}/{}", channel.put_ports, channel.put_ports_most),
            format!("{}/{}", channel.get_ports, channel.get_ports_most),
            format!("{:.1} KiB", channel.put_port_bytes as f64 / 1024.0),
            if channel.distributed {
                "  other hosts"
            } else {
                ""
            },
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Args)]
pub struct EchoArgs {
    /// The channel
    #[arg(value_name = "ID")]
    channel: String,
    #[command(flatten)]
    table: TableArgs,
    /// End after N packets [default: go on]
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// One JSON document a line
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Echoed {
    sender: String,
    sequence: u64,
    latency_us: f64,
    priority: u8,
    remote: bool,
    bytes: usize,
    /// The first bytes, hexadecimal.
    begins: String,
    lost: u64,
}

pub fn echo(arguments: &EchoArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = Table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let port = bus.raw_get_port(ChannelId::new(&arguments.channel)?)?;
    let mut seen = 0;
    while !stop.asked() && arguments.count.is_none_or(|count| seen < count) {
        let Some(packet) = port.get(LOOK)? else {
            continue;
        };
        let header = packet.header();
        let begins: String = packet.iter().take(24).map(|b| format!("{b:02x}")).collect();
        let echoed = Echoed {
            sender: format!("{:016x}", header.sender),
            sequence: header.sequence,
            latency_us: now_ns().saturating_sub(header.put_ns) as f64 / 1e3,
            priority: header.priority,
            remote: header.remote != 0,
            bytes: packet.len(),
            begins,
            lost: port.lost(),
        };
        drop(packet);
        seen += 1;
        if arguments.json {
            output::print(format_args!("{}", serde_json::to_string(&echoed)?))?;
        } else {
            output::print(format_args!(
                "{} #{:<8} {:>8.1} us {:>10} bytes {} …{}",
                &echoed.sender[..8],
                echoed.sequence,
                echoed.latency_us,
                echoed.bytes,
                echoed.begins,
                if echoed.lost > 0 {
                    format!("  lost so far: {}", echoed.lost)
                } else {
                    String::new()
                }
            ))?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Args)]
pub struct HzArgs {
    /// The channel
    #[arg(value_name = "ID")]
    channel: String,
    #[command(flatten)]
    table: TableArgs,
    /// How long to measure
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    seconds: f64,
    /// Print one JSON document instead of a line
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Rate {
    packets: usize,
    hz: f64,
    megabytes_per_s: f64,
    /// Meaningful for packets of this host only: the clocks of hosts differ.
    latency_p50_us: f64,
    latency_p99_us: f64,
    latency_max_us: f64,
    lost: u64,
}

pub fn hz(arguments: &HzArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = Table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let port = bus.raw_get_port(ChannelId::new(&arguments.channel)?)?;
    let begun = Instant::now();
    let (mut latencies, mut bytes) = (Vec::new(), 0);
    while !stop.asked() && begun.elapsed().as_secs_f64() < arguments.seconds {
        let Some(packet) = port.get(LOOK)? else {
            continue;
        };
        latencies.push(now_ns().saturating_sub(packet.header().put_ns) as f64 / 1e3);
        bytes += packet.len();
    }
    let seconds = begun.elapsed().as_secs_f64();
    latencies.sort_by(f64::total_cmp);
    let at = |share| percentile(&latencies, share).unwrap_or(0.0);
    let rate = Rate {
        packets: latencies.len(),
        hz: latencies.len() as f64 / seconds,
        megabytes_per_s: bytes as f64 / seconds / 1e6,
        latency_p50_us: at(0.5),
        latency_p99_us: at(0.99),
        latency_max_us: at(1.0),
        lost: port.lost(),
    };
    if arguments.json {
        output::print_json(&rate)?;
    } else {
        output::print(format_args!(
            "{:.1} Hz, {:.2} MB/s; latency {:.1} us, 99 % below {:.1}, at most {:.1}; {} lost",
            rate.hz,
            rate.megabytes_per_s,
            rate.latency_p50_us,
            rate.latency_p99_us,
            rate.latency_max_us,
            rate.lost
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Clone, Copy, Default, ValueEnum)]
pub enum PriorityChoice {
    /// Pictures, recordings
    Bulk,
    /// Everything else
    #[default]
    Normal,
    /// Commands
    High,
    /// Control loops
    RealTime,
}

impl PriorityChoice {
    fn priority(self) -> Priority {
        match self {
            Self::Bulk => Priority::Bulk,
            Self::Normal => Priority::Normal,
            Self::High => Priority::High,
            Self::RealTime => Priority::RealTime,
        }
    }
}

#[derive(Args)]
pub struct PutArgs {
    /// The channel
    #[arg(value_name = "ID")]
    channel: String,
    #[command(flatten)]
    table: TableArgs,
    /// Packets per second; 0: as fast as possible
    #[arg(long, value_name = "HZ", default_value_t = 200.0)]
    rate: f64,
    /// End after N packets [default: go on]
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    /// Communication priority
    #[arg(long, value_enum, default_value_t)]
    priority: PriorityChoice,
}

pub fn put(arguments: &PutArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = Table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let id = ChannelId::new(&arguments.channel)?;
    let port = bus.raw_put_port(id, arguments.priority.priority())?;
    let bytes = table.channel(&arguments.channel)?.packet_bytes();
    eprintln!(
        "putting packets of {bytes} bytes; {:.1} KiB of shared memory reserved",
        port.memory_bytes() as f64 / 1024.0
    );
    output::print(format_args!("ready"))?;
    let begun = Instant::now();
    let mut sent = 0u64;
    while !stop.asked() && arguments.count.is_none_or(|count| sent < count) {
        let mut packet = port.loan(bytes)?;
        let number = sent.to_le_bytes();
        let room = bytes.min(8);
        packet[..room].copy_from_slice(&number[..room]);
        port.put(packet)?;
        sent += 1;
        if arguments.rate > 0.0 {
            let due = begun + Duration::from_secs_f64(sent as f64 / arguments.rate);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
    }
    Ok(ExitCode::SUCCESS)
}
