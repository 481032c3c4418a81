//! `tactnet catch way`: ways of the whole body around a box.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use tactnet_catching_trials::{WayReport, WayTrials};

use super::throw_progress::every_two_seconds;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch way --scenes 100 --seed 1001 --json          how many ways are clear, and how long a plan takes\n  \
    tactnet catch way --scenes 1 --seed 3 --picture way.svg    the first scene, drawn\n\n\
    The robot looks at a table with a box of random size and place, maps them with cells of 2 cm, near the hand of 5 mm, and moves its left \
    hand from the left of the box to the right with platform, torso and arm. Scenes in which the hand has no place next to the box do not count.")]
pub struct WayArgs {
    /// Number of scenes
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=100_000))]
    scenes: u64,
    /// Seed of the first scene
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Draw the straight and the planned way of the first scene to an SVG file
    #[arg(long, value_name = "FILE.svg")]
    picture: Option<PathBuf>,
    /// Description of the robot [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Settings of the world as JSON [default: built-in]
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &WayArgs) -> anyhow::Result<ExitCode> {
    let trials = WayTrials {
        robot: super::robot(arguments.robot.as_ref())?,
        world: super::world(arguments.world.as_deref())?,
        scenes: arguments.scenes,
        seed: arguments.seed,
    };
    let report = trials.run(every_two_seconds(arguments.scenes, |done, left| {
        say!("{done} of {} scenes, {left} to go", arguments.scenes);
    }))?;
    if let Some(path) = &arguments.picture {
        let picture = trials.picture()?;
        let picture = picture.with_context(|| {
            format!(
                "scene {} has no way to draw; try another --seed",
                arguments.seed
            )
        })?;
        std::fs::write(path, picture).with_context(|| path.display().to_string())?;
    }
    OutputFormat::from_flag(arguments.json).report(&report, print_ways)
}

fn print_ways(report: &WayReport) -> anyhow::Result<()> {
    for one in &report.outcomes {
        let outcome = match &one.no_way {
            Some(reason) => reason.clone(),
            None if one.contacts > 0 => format!("contact during {} ms", one.contacts),
            None => format!("clear by {:.0} mm, {:.1} s", one.least_mm, one.seconds),
        };
        let total = one.fusion_ms + one.distances_ms + one.plan_ms;
        output::print(format_args!(
            "scene {}: {outcome}; planned in {:.0} ms, {total:.0} ms after the last picture",
            one.seed, one.plan_ms
        ))?;
    }
    let [low, high] = report.ci95.map(|share| 100.0 * share);
    output::print(format_args!(
        "{} of {} ways are clear, {:.1} % [{low:.1}, {high:.1}]; {} straight ways touch",
        report.clear,
        report.scenes,
        100.0 * report.rate,
        report.straight_touches
    ))?;
    if let Some(times) = &report.picture_to_way_ms {
        output::print(format_args!(
            "last picture to way: {:.0} ms (median), {:.0} ms (99 %)",
            times.p50, times.p99
        ))?;
    }
    Ok(())
}
