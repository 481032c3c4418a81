//! `tactnet bench catch-safety`: benchmark of the self-collision monitor.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_catching_trials::{SafetyBench, SafetyReport};

use crate::commands::catch;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench catch-safety --motions 1000000 --seed 1 --json\n\n\
    A motion begins anywhere within the joints' ranges with any velocity within their limits. Those that the monitor lets go on are braked \
    and looked at 49 times on the way.")]
pub struct SafetyBenchArgs {
    /// Number of random motions
    #[arg(long, value_name = "N", default_value_t = 10_000, value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    motions: u32,
    /// Seed of the motions
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
pub fn run(arguments: &SafetyBenchArgs) -> anyhow::Result<ExitCode> {
    let robot = catch::robot(arguments.robot.as_ref())?;
    let bench = SafetyBench {
        motions: arguments.motions as usize,
        seed: arguments.seed,
    };
    let report = bench.run(&robot, |done| {
        if done.is_multiple_of(50_000) {
            say!("{done} of {} motions", bench.motions);
        }
    });
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &SafetyReport) -> anyhow::Result<()> {
    output::print(format_args!(
        "{} random motions, {} of them begun with bodies nearer than {:.0} mm",
        report.motions,
        report.begun_too_near,
        1e3 * report.margin
    ))?;
    output::print(format_args!(
        "{} may go on; braked, bodies touch in {} of them, and come to {:.1} mm at the nearest",
        report.go,
        report.missed,
        1e3 * report.least_distance
    ))?;
    output::print(format_args!(
        "braked in vain: {} of {} motions in which bodies stay apart",
        report.braked_in_vain, report.free
    ))
}
