//! `tactnet bench catch-track`: benchmark of the tracker.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_catching::track::TrackConfig;
use tactnet_catching_trials::{TrackBench, TrackFigures, TrackReport};

use crate::commands::catch::{self, progress_of};
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench catch-track --throws 1000 --seed 1 --json\n  \
    tactnet bench catch-track --robot my_robot.toml")]
pub struct TrackBenchArgs {
    /// Number of throws of one ball each, seen from an exactly known head at rest
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    throws: u32,
    /// Seed of throws, noise and clutter
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Description of the robot [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &TrackBenchArgs) -> anyhow::Result<ExitCode> {
    let robot = catch::robot(arguments.robot.as_ref())?;
    let throws = arguments.throws as usize;
    let config = TrackConfig::default();
    let bench = TrackBench {
        throws,
        seed: arguments.seed,
        config,
    };
    let report = bench.run(&robot, progress_of(throws, "throws"))?;
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &TrackReport) -> anyhow::Result<()> {
    output::print(format_args!(
        "{} throws, predicted from the last pictures at least 200 ms before the catch (root mean squares)",
        report.throws
    ))?;
    print_figures("every ball found, no clutter", &report.without_clutter)?;
    print_figures("clutter and misses", &report.with_clutter)
}

fn print_figures(name: &str, figures: &TrackFigures) -> anyhow::Result<()> {
    output::print(format_args!(
        "{name}: {} false detections per picture, {:.0} % of balls found",
        figures.clutter,
        100.0 * figures.detection
    ))?;
    if let (Some(across), Some(along)) = (
        figures.ahead.across_mm_rms_200ms,
        figures.ahead.along_ms_rms_200ms,
    ) {
        output::print(format_args!(
            "  {across:.2} mm across the flight, {along:.2} ms along it; lost: {}",
            figures.lost
        ))?;
    }
    if let (Some(nees), Some([low, high])) = (figures.ahead.nees_200ms, figures.ahead.nees_band) {
        output::print(format_args!(
            "  normalised squared error: {nees:.2}, {low:.2} to {high:.2} if the filter's covariance is right"
        ))?;
    }
    if let Some(times) = figures.pair_us {
        output::print(format_args!(
            "  a pair of pictures: median {:.0} us, 99 % {:.0} us, longest {:.0} us",
            times.p50, times.p99, times.max
        ))?;
    }
    Ok(())
}
