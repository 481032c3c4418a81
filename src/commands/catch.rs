//! `tactnet catch`: catching balls with two arms, in the simulated world.

mod calibrate;
mod place;
mod rally;
mod recorded;
mod role;
mod run;
mod skin;
mod throw;
mod throw_progress;
mod throw_series;
#[cfg(feature = "rerun")]
mod view_calibration;
#[cfg(feature = "rerun")]
mod view_rally;
#[cfg(feature = "rerun")]
mod view_throw;
mod viewer;
mod way;

pub use throw_progress::{progress_of, throw_progress};

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Subcommand, ValueEnum};
pub use run::{felt_materials, show as show_event};
pub use skin::SkinSettings;
use tactnet_catching::Robot;
use tactnet_catching::coordinate::MAX_PLANNERS;
use tactnet_catching::plan::Objective;
use tactnet_catching_packets::RobotDescription;
use tactnet_catching_world::{PlantedErrors, WorldConfig};

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet catch run --throws 10                                  live, every part a process\n  \
    tactnet catch timing run.mcap                                  what takes how long, from a recording of such a run\n  \
    tactnet catch throw-series --throws 100 --page throws.html     how many balls are caught, and one throw drawn\n  \
    tactnet catch rally --rallies 10                               two robots play catch\n  \
    tactnet catch way --picture way.svg                            the whole body moves a hand around a box\n  \
    tactnet catch calibrate --simulate                             find what a robot's description lacks, and catch with it")]
pub enum CatchCommand {
    /// Run the whole stack live in the simulated world, one process per part
    Run(run::RunArgs),
    /// Simulate a series of throws in stepped time and count the catches
    ThrowSeries(throw_series::ThrowSeriesArgs),
    /// Simulate two robots that play catch, in stepped time
    Rally(rally::RallyArgs),
    /// Throw at a target in the simulated world, with practice
    Throw(throw::ThrowArgs),
    /// Move a hand around a box with the whole body, in a map of the robot's own depth pictures
    Way(way::WayArgs),
    /// Calibrate the robot's geometry from pictures of the markers on its wrists
    Calibrate(calibrate::CalibrateArgs),
    /// Measure the durations from an exposure to its path in a recording
    Timing(recorded::TimingArgs),
    /// Run tracker and planners on a recording again and compare the results bit by bit
    Replay(recorded::ReplayArgs),
    /// Run one process of the stack, or the world, on the channels of a table
    Role(role::RoleArgs),
}

/// Objective of a plan.
#[derive(Clone, Copy, PartialEq, ValueEnum)]
pub enum ObjectiveChoice {
    /// Minimum joint motion
    Soft,
    /// Latest catch
    Latest,
    /// Immediate motion, then waiting for the ball
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
        CatchCommand::Way(arguments) => way::run(&arguments),
        CatchCommand::Calibrate(arguments) => calibrate::run(&arguments),
        CatchCommand::Run(arguments) => run::run(&arguments),
        CatchCommand::Timing(arguments) => recorded::run_timing(&arguments),
        CatchCommand::Replay(arguments) => recorded::run_replay(&arguments),
        CatchCommand::Role(arguments) => role::run(&arguments),
    }
}

/// Parses a number of planners of an arm.
pub fn planners(text: &str) -> Result<u32, String> {
    let range = 1..=MAX_PLANNERS;
    let number = text.parse().ok().filter(|number| range.contains(number));
    number.ok_or_else(|| format!("expected a number from 1 to {MAX_PLANNERS}"))
}

/// Returns the robot of a description file, or the built-in one.
pub fn robot(path: Option<&PathBuf>) -> anyhow::Result<Robot> {
    Ok(Robot::new(description(path.map(PathBuf::as_path))?))
}

/// Returns the world of a settings file, or the built-in one.
pub fn world(path: Option<&Path>) -> anyhow::Result<WorldConfig> {
    let Some(path) = path else {
        return Ok(WorldConfig::default());
    };
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    serde_json::from_str(&text).with_context(|| path.display().to_string())
}

/// Returns the world with the planted errors of an uncalibrated robot.
///
/// - `robot`: number of the robot; `None` keeps the errors of the settings
fn planted(path: Option<&Path>, robot: Option<u64>) -> anyhow::Result<WorldConfig> {
    let mut world = world(path)?;
    if let Some(robot) = robot {
        world.errors = PlantedErrors::uncalibrated(robot);
    }
    Ok(world)
}

/// Returns an error if the folder of an output file does not exist, before a long computation.
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
