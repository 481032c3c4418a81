//! `tactnet bench catch-detect`: benchmark of the ball detector.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_catching_trials::{DetectBench, DetectFigures, DetectReport};

use crate::commands::catch::{self, progress_of};
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench catch-detect --throws 50 --seed 1 --json")]
pub struct DetectBenchArgs {
    /// Number of throws of one ball each, seen by a moving head
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    throws: u32,
    /// Seed of throws, rooms, people and noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
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
pub fn run(arguments: &DetectBenchArgs) -> anyhow::Result<ExitCode> {
    let robot = catch::robot(arguments.robot.as_ref())?;
    let bench = DetectBench {
        throws: arguments.throws as usize,
        seed: arguments.seed,
        world: catch::world(arguments.world.as_deref())?,
    };
    let progress = progress_of(bench.throws, "throws");
    let report = bench.run(&robot, progress)?;
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &DetectReport) -> anyhow::Result<()> {
    let [width, height] = report.size;
    output::print(format_args!(
        "{} throws, {} pictures of {width}x{height}",
        report.throws, report.pictures
    ))?;
    print_figures("each picture on its own", &report.search)?;
    print_figures(
        "with gates where the tracker expects the ball",
        &report.gated,
    )
}

fn print_figures(name: &str, figures: &DetectFigures) -> anyhow::Result<()> {
    output::print(format_args!(
        "{name}: {:.1} % of {} balls found, {:.1} false detections per picture",
        100.0 * figures.recall,
        figures.balls,
        figures.false_alarms
    ))?;
    for class in &figures.by_radius {
        if let (Some(recall), Some(error)) = (class.recall, class.centre_px_rms) {
            output::print(format_args!(
                "  radius from {:>2} px: {:.1} % of {}, centre to {error:.2} px (root mean square, each way)",
                class.least,
                100.0 * recall,
                class.balls
            ))?;
        }
    }
    if let Some(times) = figures.picture_ms {
        output::print(format_args!(
            "  a picture: median {:.1} ms, 99 % {:.1} ms, longest {:.1} ms",
            times.p50, times.p99, times.max
        ))?;
    }
    Ok(())
}
