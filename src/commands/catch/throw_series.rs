//! `tactnet catch throw-series`: catch rate in stepped time.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::{Args, ValueEnum};
use tactnet_catching::ChainDelays;
use tactnet_catching::plan::Objective;
use tactnet_catching_trials::{
    Ablation, Mapping, Series, SeriesReport, ThrowConfig, picture_file, series_page,
};
use tactnet_catching_world::ObstaclesConfig;

use super::planners;
use super::throw_progress::throw_progress;
use super::viewer::ViewerArgs;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch throw-series --throws 1000 --seed 1 --json\n  \
    tactnet catch throw-series --throws 200 --page throws.html       with one throw drawn\n  \
    tactnet catch throw-series --throws 1 --view                     that throw in the Rerun viewer\n  \
    tactnet catch throw-series --without imu --without replan        what they are worth\n  \
    tactnet catch throw-series --mode latest                         the latest catch instead of the smoothest\n  \
    tactnet catch throw-series --in-a-row 5                          without a return between five balls\n  \
    tactnet catch throw-series --balls 2\n  \
    tactnet catch throw-series --throws 20 --pixels                  from pictures, not from circles\n  \
    tactnet catch throw-series --throws 50 --obstacles               among a table and a box, mapped by a depth camera\n  \
    tactnet catch throw-series --throws 50 --obstacles --page obstacles.html\n  \
    tactnet catch throw-series --watch                               would the robot have braked for itself?\n  \
    tactnet catch throw-series --planted 7 --calibration calibration.toml    with what `catch calibrate --simulate --seed 7` found\n  \
    tactnet catch throw-series --timing thesis                       152 ms from exposure to path instead of 70")]
pub struct ThrowSeriesArgs {
    /// Number of throws
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u64).range(1..=1_000_000))]
    throws: u64,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of simultaneous balls
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    balls: u8,
    /// Throw N balls one after the other before the robot returns to its waiting pose; rounds `--throws` up to whole
    /// rows
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(2..=10),
        conflicts_with_all = ["obstacles", "watch", "page", "modes_picture", "ramps_picture", "fingers_picture", "view"])]
    in_a_row: Option<u64>,
    /// Delays of the stack
    #[arg(long, value_enum, default_value_t = TimingChoice::Ours)]
    timing: TimingChoice,
    /// Objective of the planners
    #[arg(long, value_enum, default_value_t = ModeChoice::Soft)]
    mode: ModeChoice,
    /// Number of planners of each arm, which share the search of a first plan
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = planners)]
    planners: u32,
    /// Part of the stack to disable; may be given more than once
    #[arg(long, value_enum, value_name = "PART")]
    without: Vec<AblationChoice>,
    /// Take the poses of head and balls from the true state
    #[arg(long)]
    perfect_perception: bool,
    /// Render the pictures of both cameras and detect balls in them; takes several seconds per throw
    #[arg(long, conflicts_with = "perfect_perception")]
    pixels: bool,
    /// Add a table and a box that is moved before each throw, or the boxes of `--world`; runs with a map of depth
    /// pictures and again without
    #[arg(long, conflicts_with = "calibration")]
    obstacles: bool,
    /// Count throws in which the self-collision monitor would have braked
    #[arg(long)]
    watch: bool,
    /// Delay of the closing of the hands, in ms; negative for early
    #[arg(
        long,
        value_name = "MS",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    closing_error: f64,
    /// Description of the robot for the stack and, apart from planted errors, the world [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Calibration from `catch calibrate` that corrects measurements and commands
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Settings of the world as JSON [default: built-in]
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
    /// Plant the errors of the uncalibrated robot with this number, as in `catch calibrate --simulate --seed N`;
    /// replaces the errors of `--world`
    #[arg(long, value_name = "N")]
    planted: Option<u64>,
    /// Write an HTML page with rates, errors over time and one drawn throw; with `--obstacles`, with and without the
    /// map
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Draw that throw alone from the side as an SVG file; with `--in-a-row`, all catches of the first row
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Draw the first throw with each `--mode` as an SVG file
    #[arg(long, value_name = "FILE")]
    modes_picture: Option<PathBuf>,
    /// Draw the desired and measured joint velocities of the page's throw as an SVG file
    #[arg(long, value_name = "FILE")]
    ramps_picture: Option<PathBuf>,
    /// Draw close-ups of the hand and its fingers in the page's throw as an SVG file
    #[arg(long, value_name = "FILE")]
    fingers_picture: Option<PathBuf>,
    #[command(flatten)]
    viewer: ViewerArgs,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum TimingChoice {
    /// 70 ms from exposure to path
    Ours,
    /// 152 ms from exposure to path, as in the thesis
    Thesis,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum ModeChoice {
    /// Smoothest motion
    Soft,
    /// Latest catch
    Latest,
    /// Earliest arrival; the hand waits for the ball
    Cool,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum AblationChoice {
    /// Inertial unit: the head pose follows from the joints
    Imu,
    /// Drag: flights are parabolas
    Drag,
    /// Replanning: the robot executes the first plan
    Replan,
    /// Multiple starts of a plan
    Multistart,
    /// Motion of platform and torso
    LowerBody,
    /// Near misses if no exact catch is possible
    NearMiss,
}

impl From<AblationChoice> for Ablation {
    fn from(choice: AblationChoice) -> Self {
        match choice {
            AblationChoice::Imu => Self::Imu,
            AblationChoice::Drag => Self::Drag,
            AblationChoice::Replan => Self::Replan,
            AblationChoice::Multistart => Self::Multistart,
            AblationChoice::LowerBody => Self::LowerBody,
            AblationChoice::NearMiss => Self::NearMiss,
        }
    }
}

/// Runs the command.
pub fn run(arguments: &ThrowSeriesArgs) -> anyhow::Result<ExitCode> {
    arguments.viewer.check()?;
    // Before a long computation.
    let files = [
        &arguments.page,
        &arguments.picture,
        &arguments.modes_picture,
        &arguments.ramps_picture,
        &arguments.fingers_picture,
    ];
    for file in files.into_iter().flatten() {
        super::check_folder(file)?;
    }
    let series = series(arguments)?;
    let report = match arguments.in_a_row {
        Some(length) => {
            let throws = arguments.throws.next_multiple_of(length);
            series.run_in_a_row(length, throw_progress(throws))?
        }
        // Every throw is simulated twice.
        None if arguments.obstacles => {
            series.run_with_and_without_map(throw_progress(2 * arguments.throws))?
        }
        None => series.run(throw_progress(arguments.throws))?,
    };
    write_pictures(arguments, &series, &report)?;
    #[cfg(feature = "rerun")]
    if let Some(target) = arguments.viewer.target() {
        super::view_throw::view(&series, &report, &target)?;
    }
    OutputFormat::from_flag(arguments.json).report(&report, |report| output::print(report))
}

fn write_pictures(
    arguments: &ThrowSeriesArgs,
    series: &Series,
    report: &SeriesReport,
) -> anyhow::Result<()> {
    let write = |path: &PathBuf, text: Option<String>| match text {
        Some(text) => std::fs::write(path, text).with_context(|| path.display().to_string()),
        None => Ok(()),
    };
    if let Some(path) = &arguments.page {
        write(path, Some(series_page(series, report)?))?;
    }
    if let Some(path) = &arguments.picture {
        let picture = match arguments.in_a_row {
            Some(length) => Some(series.row_picture(length)?),
            None => series
                .drawn(report)?
                .and_then(|(_, trace)| picture_file(&trace)),
        };
        write(path, picture)?;
    }
    if let Some(path) = &arguments.modes_picture {
        write(path, Some(series.modes_picture(0)?))?;
    }
    if let Some(path) = &arguments.ramps_picture {
        write(path, series.ramps_picture(report)?)?;
    }
    if let Some(path) = &arguments.fingers_picture {
        write(path, series.fingers_picture(report)?)?;
    }
    Ok(())
}

fn series(arguments: &ThrowSeriesArgs) -> anyhow::Result<Series> {
    let mut world = super::planted(arguments.world.as_deref(), arguments.planted)?;
    if arguments.obstacles && world.obstacles.boxes.is_empty() {
        world.obstacles = ObstaclesConfig::table_and_box();
    }
    let mut without: Vec<Ablation> = arguments
        .without
        .iter()
        .map(|choice| (*choice).into())
        .collect();
    without.sort();
    without.dedup();
    let robot = super::robot(arguments.robot.as_ref())?;
    let calibration = super::calibrate::calibration(arguments.calibration.as_deref(), &robot)?;
    Ok(Series {
        config: ThrowConfig {
            calibration: calibration.map(|kept| kept.parameters),
            timing: match arguments.timing {
                TimingChoice::Ours => ChainDelays::ours(),
                TimingChoice::Thesis => ChainDelays::thesis(),
            },
            objective: match arguments.mode {
                ModeChoice::Soft => Objective::Soft,
                ModeChoice::Latest => Objective::Latest,
                ModeChoice::Cool => Objective::Cool,
            },
            planners: arguments.planners,
            without,
            balls: arguments.balls.into(),
            perfect_perception: arguments.perfect_perception,
            pixels: arguments.pixels,
            watch: arguments.watch,
            mapping: match arguments.obstacles {
                true => Mapping::Depth,
                false => Mapping::Off,
            },
            closing_error: 1e-3 * arguments.closing_error,
            ..ThrowConfig::new(robot, world)
        },
        throws: arguments.throws,
        seed: arguments.seed,
    })
}
