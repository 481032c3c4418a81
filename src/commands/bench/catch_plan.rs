//! `tactnet bench catch-plan`: benchmark of the planner.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_catching_trials::{PlanBench, PlanReport};

use crate::commands::catch::{self, ObjectiveChoice, progress_of};
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench catch-plan --problems 10000 --json\n  \
    tactnet bench catch-plan --objective cool --robot my_robot.toml")]
pub struct PlanBenchArgs {
    /// Number of feasible problems
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    problems: u32,
    /// Seed of the problems
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Objective of the plans
    #[arg(long, value_enum, default_value_t = ObjectiveChoice::Soft)]
    objective: ObjectiveChoice,
    /// Number of threads that share the search of a first plan
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = catch::planners)]
    planners: u32,
    /// Description of the robot [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &PlanBenchArgs) -> anyhow::Result<ExitCode> {
    let robot = catch::robot(arguments.robot.as_ref())?;
    let problems = arguments.problems as usize;
    let bench = PlanBench {
        problems,
        seed: arguments.seed,
        objective: arguments.objective.into(),
        planners: arguments.planners as usize,
    };
    let report = bench.run(&robot, progress_of(problems, "problems"));
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &PlanReport) -> anyhow::Result<()> {
    output::print(format_args!(
        "{} problems ({} were drawn; the others have no solution that a dense grid or the planner finds)",
        report.problems, report.drawn
    ))?;
    output::print(format_args!("                 median      99 %   longest"))?;
    let times = [
        ("first plan", Some(report.first_plan_ms)),
        ("re-plan", report.replan_ms),
    ];
    for (name, times) in times {
        if let Some(times) = times {
            output::print(format_args!(
                "{name:<12}{:>8.2} ms{:>7.2} ms{:>7.2} ms",
                times.p50, times.p99, times.max
            ))?;
        }
    }
    output::print(format_args!(
        "missed: {} ({:.3} %); found beyond the grid: {}; re-plans missed: {}",
        report.missed,
        100.0 * report.missed_of_feasible,
        report.beyond_oracle,
        report.replans_missed
    ))?;
    output::print(format_args!(
        "cost over the best known: median {:.4} %, 99 % {:.4} %",
        100.0 * report.cost_gap_p50,
        100.0 * report.cost_gap_p99
    ))
}
