//! `tactnet simulate`: what a robot would put on the channels, for people without one.

mod catching;
mod skin;
mod soak;

use std::path::Path;
use std::process::ExitCode;

use clap::Subcommand;
use tactnet_data::Dataset;
use tactnet_pipeline::{RunDir, TestSweeps};

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet simulate skin --table robot.toml --materials wood,cork     sweeps over wood and cork, in turns, in real time\n  \
    tactnet simulate catching --table robot.toml --seconds 10          cameras, tracker, planner and the 1 kHz loop beside it\n  \
    tactnet simulate soak --seconds 30 --run runs/a --json             all of it at once, measured")]
pub enum SimulateCommand {
    /// Put sweeps of a data set on the skin's channel in real time, with commands
    Skin(skin::SkinArgs),
    /// Run the load of the ball catching stack (thesis, figure 3.2) and measure its 1 kHz loop
    Catching(catching::CatchingArgs),
    /// Run hub, skin, catching stack, classifier and dashboard together and measure what they do to each other
    Soak(soak::SoakArgs),
}

/// Runs the command.
pub fn run(command: SimulateCommand) -> anyhow::Result<ExitCode> {
    match command {
        SimulateCommand::Skin(arguments) => skin::run(&arguments),
        SimulateCommand::Catching(arguments) => catching::run(&arguments),
        SimulateCommand::Soak(arguments) => soak::run(&arguments),
    }
}

/// Returns the numbers of sweeps that a run has learnt nothing from.
fn unseen_by(dataset: &Dataset, run: &Path) -> anyhow::Result<Vec<usize>> {
    let run = RunDir::open(run)?;
    let unseen = TestSweeps::unseen(dataset, &run.config()?, &run.split()?)?;
    let view = unseen.without_enrolled(&run)?.view;
    Ok(view.indices().to_vec())
}
