//! `tactnet channel put`: test packets.

use std::process::ExitCode;

use clap::{Args, ValueEnum};
use tactnet_channel::{Bus, ChannelId, Domain, Priority};
use tactnet_channel_stress::put_numbered;

use super::TableArgs;
use crate::output;
use crate::stop::Stop;
use crate::table;

#[derive(Clone, Copy, Default, ValueEnum)]
pub enum PriorityChoice {
    /// For images and recordings
    Bulk,
    /// For everything else
    #[default]
    Normal,
    /// For commands
    High,
    /// For control loops
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
    /// End after N packets [default: no limit]
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    /// Priority on this host and between hosts: urgent packets are delivered before waiting bulk
    #[arg(long, value_enum, default_value_t)]
    priority: PriorityChoice,
}

pub fn put(arguments: &PutArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(&arguments.table.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let id = ChannelId::new(&arguments.channel)?;
    let port = bus.raw_put_port(id, arguments.priority.priority())?;
    let bytes = table.channel(&arguments.channel)?.packet_bytes();
    say!(
        "putting packets of {bytes} bytes; {:.1} KiB of shared memory reserved",
        port.memory_bytes() as f64 / 1024.0
    );
    output::print(format_args!("ready"))?;
    let count = arguments.count.unwrap_or(u64::MAX);
    put_numbered(&port, bytes, arguments.rate, count, &|| stop.asked())?;
    Ok(ExitCode::SUCCESS)
}
