//! `tactnet bench`: how fast this machine is at what takes long.

mod device;

use std::process::ExitCode;

use clap::Subcommand;

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet bench device             training on every device of this machine\n  \
    tactnet bench device --json      the same for programs")]
pub enum BenchCommand {
    /// Time training on every device that is present
    Device(device::DeviceArgs),
}

/// Runs the command.
pub fn run(command: BenchCommand) -> anyhow::Result<ExitCode> {
    match command {
        BenchCommand::Device(arguments) => device::run(&arguments),
    }
}
