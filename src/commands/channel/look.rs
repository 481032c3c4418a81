//! `tactnet channel list`, `echo` and `hz`: channels, packets and rates of a bus.

use std::fmt;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::Context;
use clap::Args;
use serde::Serialize;
use tactnet_channel::{
    Bus, ChannelConfig, ChannelId, Description, Domain, ListedChannel, ReceivedSummary, Start,
    Wait, list_channels, measure_rate,
};
use tactnet_skin::packets::ModelNames;
use tactnet_skin::{ReadablePacket, ServeConfig};

use super::TableArgs;
use super::packet_text::PacketText;
use super::packets::{DescribedPacket, OwnPacketsArgs};
use crate::output;
use crate::stop::Stop;
use crate::table;

/// Maximum sleep, which bounds the reaction time to Ctrl-C.
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

pub fn list(arguments: &ListArgs) -> anyhow::Result<ExitCode> {
    let table = table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let listed = list_channels(&bus, &table)?;
    if arguments.json {
        output::print_json(&listed)?;
        return Ok(ExitCode::SUCCESS);
    }
    output::print(format_args!(
        "{:<24} {:<16} {:>12} {:>8} {:>8} {:>16}",
        "channel", "packet", "bytes", "putting", "getting", "memory of a put"
    ))?;
    for channel in &listed {
        print_channel(channel)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn print_channel(channel: &ListedChannel) -> anyhow::Result<()> {
    output::print(format_args!(
        "{:<24} {:<16} {:>12} {:>8} {:>8} {:>16}{}",
        channel.id,
        channel.packet,
        channel.packet_bytes,
        format!("{}/{}", channel.put_ports, channel.max_put_ports),
        format!("{}/{}", channel.get_ports, channel.max_get_ports),
        format!("{:.1} KiB", channel.put_port_bytes as f64 / 1024.0),
        if channel.distributed {
            "  other hosts"
        } else {
            ""
        },
    ))
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel echo tactile/belief --table robot.toml                     until Ctrl-C\n  \
    tactnet channel echo tactile/belief --table robot.toml --count 1 --json    the next one, as JSON\n  \
    tactnet channel echo arm/state --table arm_table.toml --packets arm.toml   packets of your own")]
pub struct EchoArgs {
    /// The channel
    #[arg(value_name = "ID")]
    channel: String,
    #[command(flatten)]
    table: TableArgs,
    #[command(flatten)]
    own: OwnPacketsArgs,
    /// End after N packets [default: no limit]
    #[arg(long, value_name = "N")]
    count: Option<usize>,
    /// Print one JSON document per line
    #[arg(long)]
    json: bool,
}

/// A received packet, with its content if the type is known.
#[derive(Serialize)]
struct Echoed {
    #[serde(flatten)]
    received: ReceivedSummary,
    #[serde(skip_serializing_if = "Option::is_none")]
    packet: Option<Contents>,
}

/// Content of a packet.
#[derive(Serialize)]
#[serde(untagged)]
enum Contents {
    /// With names instead of numbers.
    Tactile(ReadablePacket),
    /// Field by field.
    Described(DescribedPacket),
}

impl Contents {
    fn new(
        own: Option<&Description>,
        config: &ChannelConfig,
        bytes: &[u8],
        network: Option<&ModelNames>,
    ) -> Option<Self> {
        let readable = ReadablePacket::new(&config.packet, config.version, bytes, network);
        readable.map(Self::Tactile).or_else(|| {
            DescribedPacket::new(own, &config.packet, config.version, bytes).map(Self::Described)
        })
    }
}

impl fmt::Display for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tactile(packet) => PacketText(packet).fmt(f),
            Self::Described(packet) => packet.fields().fmt(f),
        }
    }
}

impl fmt::Display for Echoed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { received, packet } = self;
        match packet {
            Some(packet) => write!(f, "#{:<8} {packet}", received.sequence)?,
            None => write!(
                f,
                "{} #{:<8} {:>8.1} us {:>10} bytes {} …",
                &received.sender[..8],
                received.sequence,
                received.latency_us,
                received.bytes,
                received.begins
            )?,
        }
        match received.lost {
            0 => Ok(()),
            lost => write!(f, "  lost so far: {lost}"),
        }
    }
}

pub fn echo(arguments: &EchoArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let own = arguments.own.description()?;
    let table = table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let port = bus.raw_get_port(ChannelId::new(&arguments.channel)?)?;
    let config = table.channel(&arguments.channel)?;
    // Names of materials and length of a sweep, if a classifier serves.
    let models = ServeConfig::of(&table)
        .ok()
        .and_then(|config| bus.get_port(config.model.as_str(), Start::History(1)).ok());
    let mut network = None;
    let mut seen = 0;
    while !stop.asked() && arguments.count.is_none_or(|count| seen < count) {
        let Some(packet) = port.get(LOOK)? else {
            continue;
        };
        if let Some(model) = &models {
            while let Some(model) = model.try_get()? {
                network = model.first().copied().map(Box::new);
            }
        }
        let echoed = Echoed {
            received: ReceivedSummary::new(&packet, &port),
            packet: Contents::new(own.as_ref(), config, &packet, network.as_deref()),
        };
        drop(packet);
        seen += 1;
        if arguments.json {
            output::print(serde_json::to_string(&echoed)?)?;
        } else {
            output::print(echoed)?;
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
    /// Duration of the measurement
    #[arg(long, value_name = "S", default_value_t = 5.0)]
    seconds: f64,
    /// Print one JSON document instead of a line
    #[arg(long)]
    json: bool,
}

pub fn hz(arguments: &HzArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let port = bus.raw_get_port(ChannelId::new(&arguments.channel)?)?;
    let time = Duration::try_from_secs_f64(arguments.seconds)
        .with_context(|| format!("--seconds: found {}", arguments.seconds))?;
    let rate = measure_rate(&port, time, &|| stop.asked())?;
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
