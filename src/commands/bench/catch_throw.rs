//! `tactnet bench catch-throw`: throws of maximum distance.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_catching_trials::{ThrowBench, ThrowReport};

use crate::commands::catch::{self, throw_progress};
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet bench catch-throw --throws 100 --seed 1 --json\n  \
    tactnet bench catch-throw --wheels 0.36                  the platform turns: 1.4 m/s at its wheels")]
pub struct ThrowBenchArgs {
    /// Number of throws in the simulated world, alternating between both arms
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    throws: u32,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Height at which flights end, in m
    #[arg(long, value_name = "M", default_value_t = 1.1)]
    height: f64,
    /// Distance of the wheels from the centre of the turning platform, in m [default: the vertical axis of the torso turns]
    #[arg(long, value_name = "M")]
    wheels: Option<f64>,
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
pub fn run(arguments: &ThrowBenchArgs) -> anyhow::Result<ExitCode> {
    let bench = ThrowBench {
        height: arguments.height,
        wheels: arguments.wheels,
        robot: catch::robot(arguments.robot.as_ref())?,
        world: catch::world(arguments.world.as_deref())?,
        throws: arguments.throws as usize,
        seed: arguments.seed,
    };
    let report = bench.run(throw_progress(u64::from(arguments.throws)))?;
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &ThrowReport) -> anyhow::Result<()> {
    let [mean, least, greatest] = report.distance_m;
    output::print(format_args!(
        "planned: {:.2} m down to {} m, {:.2} m/s at the release",
        report.planned_m, report.height_m, report.planned_speed_m_s
    ))?;
    output::print(format_args!(
        "flown:   {mean:.2} m ({least:.2} to {greatest:.2}), {:.2} m/s, {} throws",
        report.speed_m_s, report.throws
    ))?;
    output::print(format_args!(
        "release 2 ms early or late: {:.0} mm shorter, {:.0} mm displaced",
        report.distance_lost_mm_at_2ms, report.displaced_mm_at_2ms
    ))?;
    let speeds: Vec<String> = report
        .speed_by_joint_m_s
        .iter()
        .map(|speed| format!("{speed:.2}"))
        .collect();
    output::print(format_args!(
        "contributions of the joints to the planned speed (turn, then arm), m/s: {}",
        speeds.join(", ")
    ))?;
    let joints: Vec<String> = report.at_limit.iter().map(ToString::to_string).collect();
    output::print(format_args!(
        "joints at their speed limit (0: turn, 1 to 7: arm): {}",
        joints.join(", ")
    ))?;
    let torques: Vec<String> = report
        .torques_nm
        .iter()
        .map(|torque| format!("{torque:.0}"))
        .collect();
    output::print(format_args!("maximum torques, Nm: {}", torques.join(", ")))?;
    if let Some(times) = report.plan_ms {
        output::print(format_args!(
            "planning: median {:.0} ms, maximum {:.0} ms",
            times.p50, times.max
        ))?;
    }
    print_speeds(report)
}

/// Prints the speed limits that reach the goal.
fn print_speeds(report: &ThrowReport) -> anyhow::Result<()> {
    let goal = &report.goal;
    let arm = goal
        .arm_times
        .map(|times| format!("an arm {times:.2} times as fast"));
    let turn = goal
        .turn_deg_s
        .map(|speed| format!("a turn with {speed:.0} deg/s"));
    let takes: Vec<String> = arm.into_iter().chain(turn).collect();
    output::print(format_args!(
        "planned flights of {} m need {}",
        goal.goal_m,
        if takes.is_empty() {
            "more than three times the speed limits".into()
        } else {
            takes.join(", or ")
        }
    ))
}
