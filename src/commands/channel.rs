//! `tactnet channel`: the hub, and tools to inspect a bus.

mod command;
mod look;
mod packet_text;
pub mod packets;
mod put;
mod stress;
mod stress_choices;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, Subcommand};
use tactnet_channel::Hub;
use tactnet_models::MissingFeature;

use crate::output;
use crate::stop::Stop;
use crate::table;

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet channel hub --table channels.toml &                hold the channels of this host\n  \
    tactnet channel put skin/right --table channels.toml       test packets, 200 per second\n  \
    tactnet channel list --table channels.toml                 channels and connected ports\n  \
    tactnet channel hz skin/right --table channels.toml        rate, latency, losses\n  \
    tactnet channel command reset --table robot.toml           tell the classifier that the next sweep is of another object\n  \
    tactnet channel stress --against iceoryx2                  round trips on this machine")]
pub enum ChannelCommand {
    /// Run the hub: hold all channels of the table on this host, clean up after dead clients, connect to other hosts
    Hub(HubArgs),
    /// List the channels of the table with connected ports and memory
    List(look::ListArgs),
    /// Print the packets of a channel as they arrive; packets of unknown types as bytes
    Echo(look::EchoArgs),
    /// Measure rate, latency and losses of a channel
    Hz(look::HzArgs),
    /// Command the online classifier: start or stop a sweep, forget the object, learn a material
    Command(command::CommandArgs),
    /// Put packets of zeros into a channel at a steady rate
    Put(put::PutArgs),
    /// Print packet descriptions as a page, C, C++, Python or Protocol Buffers
    Packets(packets::PacketsArgs),
    /// Measure round trips of packets, compared with other transports
    Stress(stress::StressArgs),
    /// Run a hub or client of the stress test (started by `stress`)
    #[command(hide = true)]
    StressChild,
}

#[derive(Args)]
pub struct TableArgs {
    /// Table of channels; `tactnet serve --print-table` prints one
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
}

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel hub --table channels.toml\n  \
    tactnet channel hub --table robot.toml &       in the background; SIGTERM ends it")]
pub struct HubArgs {
    #[command(flatten)]
    table: TableArgs,
}

/// Runs the command.
pub fn run(command: ChannelCommand) -> anyhow::Result<ExitCode> {
    match command {
        ChannelCommand::Hub(arguments) => hub(&arguments),
        ChannelCommand::List(arguments) => look::list(&arguments),
        ChannelCommand::Echo(arguments) => look::echo(&arguments),
        ChannelCommand::Hz(arguments) => look::hz(&arguments),
        ChannelCommand::Command(arguments) => command::run(&arguments),
        ChannelCommand::Put(arguments) => put::put(&arguments),
        ChannelCommand::Packets(arguments) => packets::packets(&arguments),
        ChannelCommand::Stress(arguments) => stress::run(arguments),
        ChannelCommand::StressChild => stress::child(),
    }
}

fn hub(arguments: &HubArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(&arguments.table.table)?;
    let distributed = table.channels.values().any(|channel| channel.distributed);
    let endpoints = table.network.listen.len() + table.network.connect.len();
    if distributed && endpoints > 0 && !cfg!(feature = "zenoh") {
        let table = arguments.table.table.display();
        return Err(anyhow::Error::from(MissingFeature { feature: "zenoh" })
            .context(format!("{table}: the table has channels between hosts")));
    }
    let mut hub = Hub::start(&table)?;
    say!(
        "holding {} of bus `{}`; Ctrl-C ends",
        output::counted(table.channels.len(), "channel"),
        table.bus
    );
    output::print(format_args!("ready"))?;
    while !stop.asked() {
        let cleaned = hub.tick()?;
        if cleaned > 0 {
            say!(
                "cleaned up after {}",
                output::counted(cleaned, "dead client")
            );
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(ExitCode::SUCCESS)
}
