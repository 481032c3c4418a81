//! `tactnet catch role`: one process of the stack, or the world, on the channels of a table.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use serde::de::DeserializeOwned;
use tactnet_catching_roles::Role;
use tactnet_catching_stage::WorldRole;
use tactnet_channel::{Bus, Domain};
use tactnet_serving::Realtime;

use super::skin::{self, SkinSettings};
use crate::output;
use crate::stop::Stop;
use crate::table;

/// Name of the world's process.
const WORLD: &str = "world";
const SKIN: &str = "skin";

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch role tracker --table robot.toml        circles in, predictions out\n  \
    tactnet catch role controller --table robot.toml --priority 80\n  \
    echo '{\"seed\": 7}' | tactnet catch role world --table robot.toml     the simulated robot; its settings are read from standard input\n\n\
    `tactnet catch run` starts all of them. A table is what `tactnet catch role --print-table` prints; a hub has to run.")]
pub struct RoleArgs {
    /// safety, hand, planner-left, planner-right, pose, tracker, eyes, controller, coordinator, feel, thrower, slip-watch, world or skin
    #[arg(required_unless_present = "print_table")]
    role: Option<String>,
    /// Table of channels
    #[arg(long, value_name = "FILE", required_unless_present = "print_table")]
    table: Option<PathBuf>,
    /// Run under SCHED_FIFO with this priority
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Print a table with the channels and settings of the stack, and exit
    #[arg(long)]
    print_table: bool,
}

/// Runs the command.
pub fn run(arguments: &RoleArgs) -> anyhow::Result<ExitCode> {
    let (Some(name), Some(path)) = (&arguments.role, &arguments.table) else {
        output::print(print_table()?.trim_end())?;
        return Ok(ExitCode::SUCCESS);
    };
    let process = match name.as_str() {
        WORLD => Process::World(Box::new(WorldRole {
            settings: from_input()?.unwrap_or_default(),
        })),
        SKIN => Process::Skin(from_input()?.context("expected settings on standard input")?),
        name => Process::Role(name.parse()?),
    };
    let stop = Stop::listen_saying("stopping")?;
    let bus = Bus::open(Domain::Host, &table::load(path)?)?;
    let realtime = Realtime {
        priority: arguments.priority,
        ..Realtime::default()
    };
    for line in realtime.apply() {
        say!("{line}; going on without");
    }
    let ready = || {
        // Without a reader, no process waits for this line.
        let _ = output::print(format_args!("ready"));
    };
    let stopped = || stop.asked();
    match process {
        Process::Role(role) => output::print_json(&role.run(&bus, &ready, &stopped)?)?,
        Process::World(world) => output::print_json(&world.run(&bus, &ready, &stopped)?)?,
        Process::Skin(settings) => skin::run(&settings, &bus, &ready, &stopped)?,
    }
    Ok(ExitCode::SUCCESS)
}

enum Process {
    Role(Role),
    World(Box<WorldRole>),
    Skin(SkinSettings),
}

/// Reads settings from one line of standard input; `None` if it is empty.
fn from_input<T: DeserializeOwned>() -> anyhow::Result<Option<T>> {
    let mut line = String::new();
    std::io::stdin().read_line(&mut line)?;
    if line.trim().is_empty() {
        return Ok(None);
    }
    serde_json::from_str(&line).context("settings on standard input")
}

fn print_table() -> anyhow::Result<String> {
    let settings = tactnet_catching_roles::RoleSettings::default();
    let cameras = settings.robot()?.description().cameras;
    let pixels = cameras.width as usize * cameras.height as usize;
    let table = tactnet_channel::Table::new("robot");
    let table = tactnet_catching_roles::catching_channels(table, Some(pixels));
    Ok(settings.into_table(table).to_toml())
}
