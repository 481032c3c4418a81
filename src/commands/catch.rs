//! `tactnet catch`: catching balls with two arms, in a simulated world.

mod calibrate;
mod place;
mod rally;
mod recorded;
mod role;
mod run;
mod skin;
mod throw;
mod throw_series;
#[cfg(feature = "rerun")]
mod view_calibration;
#[cfg(feature = "rerun")]
mod view_rally;
#[cfg(feature = "rerun")]
mod view_throw;
mod viewer;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Subcommand, ValueEnum};
pub use run::{felt_materials, show as show_event};
pub use skin::SkinSettings;
use tactnet_catching::Robot;
use tactnet_catching::plan::Objective;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_world::{PlantedErrors, WorldConfig};

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet catch run --throws 10                                  live, every part a process\n  \
    tactnet catch timing run.mcap                                  what takes how long, from a recording of such a run\n  \
    tactnet catch throw-series --throws 100 --page throws.html     how many balls are caught, and one throw drawn\n  \
    tactnet catch rally --rallies 10                               two robots play catch\n  \
    tactnet catch calibrate --simulate                             find what a robot's description lacks, and catch with it")]
pub enum CatchCommand {
    /// Run the whole stack live, a process for each part, before the simulated world
    Run(run::RunArgs),
    /// Throw balls at the simulated robot, in stepped time, and count what it catches
    ThrowSeries(throw_series::ThrowSeriesArgs),
    /// Let two robots play catch, in stepped time: each throws back what it has caught
    Rally(rally::RallyArgs),
    /// Throw as far as possible, or at a place, as planned and in the simulated world
    Throw(throw::ThrowArgs),
    /// Find what the robot's description lacks, from markers at its wrists before its cameras
    Calibrate(calibrate::CalibrateArgs),
    /// Say from a recording what takes how long, from an exposure to its path
    Timing(recorded::TimingArgs),
    /// Ask tracker and planners again what a recording holds, and compare bit by bit
    Replay(recorded::ReplayArgs),
    /// Run one process of the stack, or the world, on the channels of a table
    Role(role::RoleArgs),
}

/// What a plan seeks.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum ObjectiveChoice {
    /// The gentlest motion
    Soft,
    /// The latest catch
    Latest,
    /// Move at once and wait for the ball
    Cool,
}

impl From<ObjectiveChoice> for Objective {
    fn from(choice: ObjectiveChoice) -> Self {
        match choice {
            ObjectiveChoice::Soft => Self::Soft,
            ObjectiveChoice::Latest => Self::Latest,
            ObjectiveChoice::Cool => Self::Cool,
        }
    }
}

/// Runs the command.
pub fn run(command: CatchCommand) -> anyhow::Result<ExitCode> {
    match command {
        CatchCommand::ThrowSeries(arguments) => throw_series::run(&arguments),
        CatchCommand::Rally(arguments) => rally::run(&arguments),
        CatchCommand::Throw(arguments) => throw::run(&arguments),
        CatchCommand::Calibrate(arguments) => calibrate::run(&arguments),
        CatchCommand::Run(arguments) => run::run(&arguments),
        CatchCommand::Timing(arguments) => recorded::run_timing(&arguments),
        CatchCommand::Replay(arguments) => recorded::run_replay(&arguments),
        CatchCommand::Role(arguments) => role::run(&arguments),
    }
}

/// Returns the robot that a file describes, or the one that is built in.
pub fn robot(path: Option<&PathBuf>) -> anyhow::Result<Robot> {
    Ok(Robot::new(description(path.map(PathBuf::as_path))?))
}

/// Returns the world that a file describes, or the one that is built in.
pub fn world(path: Option<&Path>) -> anyhow::Result<WorldConfig> {
    let Some(path) = path else {
        return Ok(WorldConfig::default());
    };
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

/// The same, with a robot that was put together and never calibrated.
///
/// - `robot`: its number; `None`: the world's own errors
fn planted(path: Option<&Path>, robot: Option<u64>) -> anyhow::Result<WorldConfig> {
    let mut world = world(path)?;
    if let Some(robot) = robot {
        world.errors = PlantedErrors::uncalibrated(robot);
    }
    Ok(world)
}

/// Fails where a file cannot be written because its folder is missing: before something is run in vain.
fn check_folder(file: &Path) -> anyhow::Result<()> {
    if let Some(folder) = file.parent()
        && !(folder.as_os_str().is_empty() || folder.is_dir())
    {
        anyhow::bail!("{}: no such folder", folder.display());
    }
    Ok(())
}

fn description(path: Option<&Path>) -> anyhow::Result<RobotDescription> {
    let Some(path) = path else {
        return Ok(RobotDescription::nominal());
    };
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    RobotDescription::parse(&text).with_context(|| path.display().to_string())
}
