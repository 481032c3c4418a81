//! `tactnet catch throw`: throws at a target, with practice.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_catching_packets::ARMS;
use tactnet_catching_trials::{ThrowAim, ThrowAimReport};

use super::place::place;
use super::throw_progress::throw_progress;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch throw --at 4.2,0,1.2 --practice 3          prints the learnt offsets for `catch run --aim-beside`\n  \
    tactnet catch throw --at 4.2,0,1.2 --throws 100 --json\n\n\
    `tactnet bench catch-throw` measures the maximum distance.")]
pub struct ThrowArgs {
    /// Number of throws per round, alternating between both arms
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    throws: u32,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Target of the throws, in m (x ahead, y left, z up)
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = place)]
    at: [f64; 3],
    /// Offset of the aim from the target, in m; once for both hands, or for the left and then the right hand
    #[arg(long, value_name = "DX,DY,DZ", allow_hyphen_values = true, value_parser = place)]
    aim_beside: Vec<[f64; 3]>,
    /// Number of practice rounds; the mean error of a round corrects the aim of the next
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=20))]
    practice: u8,
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
pub fn run(arguments: &ThrowArgs) -> anyhow::Result<ExitCode> {
    let aim = ThrowAim {
        robot: super::robot(arguments.robot.as_ref())?,
        world: super::world(arguments.world.as_deref())?,
        wheels: arguments.wheels,
        target: arguments.at,
        beside: hands(&arguments.aim_beside)?,
        practice: usize::from(arguments.practice),
        // At least one throw per hand.
        throws: (arguments.throws as usize).max(ARMS),
        seed: arguments.seed,
    };
    let rounds = u64::from(arguments.practice) + 1;
    let report = aim.run(throw_progress(u64::from(arguments.throws) * rounds))?;
    OutputFormat::from_flag(arguments.json).report(&report, print_aim)
}

/// Returns the offsets of the aim for the left and the right hand from the values of `--aim-beside`.
pub fn hands(aim_beside: &[[f64; 3]]) -> anyhow::Result<[[f64; 3]; ARMS]> {
    match *aim_beside {
        [] => Ok([[0.0; 3]; ARMS]),
        [both] => Ok([both; ARMS]),
        [left, right] => Ok([left, right]),
        _ => bail!(
            "--aim-beside: given {} times; expected once, or for the left and the right hand",
            aim_beside.len()
        ),
    }
}

fn print_aim(report: &ThrowAimReport) -> anyhow::Result<()> {
    for (number, round) in report.rounds.iter().enumerate() {
        output::print(format_args!(
            "round {}: {:.0} mm from the target (median), 95 % below {:.0}, maximum {:.0}; {} throws",
            number + 1,
            round.miss_p50_mm,
            round.miss_p95_mm,
            round.miss_max_mm,
            report.throws
        ))?;
    }
    let Some(last) = report.rounds.last() else {
        return Ok(());
    };
    let aims = last
        .aim_beside_m
        .map(|[x, y, z]| format!("--aim-beside={x:.3},{y:.3},{z:.3}"));
    output::print(format_args!(
        "the last round's aim: {} (left hand, right hand)",
        aims.join(" ")
    ))
}
