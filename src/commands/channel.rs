//! `tactnet channel`: the hub, and what people need to look at a bus.

mod command;
mod look;
mod packet_text;
mod packets;
mod put;
mod stress;
mod stress_choices;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, Subcommand};
use tactnet_channel::Hub;
use tactnet_models::left_out;

use crate::output;
use crate::stop::Stop;
use crate::table;

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet channel hub --table channels.toml &                hold the channels of this host\n  \
    tactnet channel put skin/right --table channels.toml       something to look at, 200 packets a second\n  \
    tactnet channel list --table channels.toml                 what is there, who is connected\n  \
    tactnet channel hz skin/right --table channels.toml        rate, latency, losses\n  \
    tactnet channel command reset --table robot.toml           to the online classifier: the next sweep is of another object\n  \
    tactnet channel stress --against iceoryx2,unix             how fast it is on this machine")]
pub enum ChannelCommand {
    /// Hold all channels of the table on this host, clean up after dead clients, connect to other hosts
    Hub(HubArgs),
    /// Show the table's channels, who is connected, and what memory they take
    List(look::ListArgs),
    /// Print packets of a channel as they come: beliefs, frames, commands and events in words, others as bytes
    Echo(look::EchoArgs),
    /// Measure rate, latency and losses of a channel
    Hz(look::HzArgs),
    /// Tell the online classifier that a sweep starts or stops, to forget an object, or to learn a material
    Command(command::CommandArgs),
    /// Put packets of zeros into a channel at a steady rate
    Put(put::PutArgs),
    /// Print what packets hold, as a page or as code for C, C++, Python and Protocol Buffers
    Packets(packets::PacketsArgs),
    /// Measure how fast packets travel, beside other transports
    Stress(stress::StressArgs),
    /// A client of the stress test: what `stress` starts
    #[command(hide = true)]
    StressClient,
}

#[derive(Args)]
pub struct TableArgs {
    /// The table of channels; `tactnet serve --print-table` prints one
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
}

#[derive(Args)]
#[command(after_help = "Example: tactnet channel hub --table channels.toml")]
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
        ChannelCommand::StressClient => stress::client(),
    }
}

fn hub(arguments: &HubArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(&arguments.table.table)?;
    let distributed = table.channels.values().any(|channel| channel.distributed);
    let endpoints = table.network.listen.len() + table.network.connect.len();
    if distributed && endpoints > 0 && !cfg!(feature = "zenoh") {
        anyhow::bail!(
            "{}: it has channels between hosts, and {}",
            arguments.table.table.display(),
            left_out("zenoh")
        );
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
