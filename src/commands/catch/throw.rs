//! `tactnet catch throw`: how far the robot throws, and how near to a place.

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::{Context, bail};
use clap::Args;
use tactnet_catching::{ChainDelays, Robot};
use tactnet_catching_packets::ARMS;
use tactnet_catching_trials::{
    ThrowAim, ThrowAimReport, ThrowBench, ThrowBenchConfig, ThrowReport, peer_throws,
};

use super::place::place;
use crate::commands::progress_line::about;
use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch throw --throws 100 --seed 1 --json\n  \
    tactnet catch throw --wheels 0.36                        the platform turns: 1.4 m/s at its wheels\n  \
    tactnet catch throw --at 4.2,0,1.2 --practice 3          to a place, and what to aim beside it: for `catch run --aim-beside`\n  \
    tactnet catch throw --peer-throws throws.json            for other planners")]
pub struct ThrowArgs {
    /// Throws in the simulated world, of both arms in turn; with `--at`, of each round
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    throws: u32,
    /// Of noise, balls, everything drawn
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Throw to this place, m (x ahead, y left, z up), instead of as far as possible
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, conflicts_with_all = ["height", "peer_throws"], value_parser = place)]
    at: Option<[f64; 3]>,
    /// Aim so far beside it, m; given twice: with the left hand, then with the right
    #[arg(long, value_name = "DX,DY,DZ", requires = "at", allow_hyphen_values = true, value_parser = place)]
    aim_beside: Vec<[f64; 3]>,
    /// Rounds of practice: by how much balls came down beside it on average is taken from the next aim
    #[arg(long, value_name = "N", requires = "at", default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=20))]
    practice: u8,
    /// Flights end at this height, m [default: 1.1]
    #[arg(long, value_name = "M")]
    height: Option<f64>,
    /// The platform turns on wheels so far from its middle, m [default: the torso's vertical axis turns]
    #[arg(long, value_name = "M")]
    wheels: Option<f64>,
    /// The robot [default: the one that simulations use]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Settings of the world, JSON [default: the ones built in]
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
    /// Write throws, where descents begin and what ours found, as JSON, and measure nothing else
    #[arg(long, value_name = "FILE")]
    peer_throws: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &ThrowArgs) -> anyhow::Result<ExitCode> {
    let robot = super::robot(arguments.robot.as_ref())?;
    let throws = arguments.throws as usize;
    if let Some(path) = &arguments.peer_throws {
        let throws = peer_throws(&robot, arguments.seed, throws)?;
        std::fs::write(path, serde_json::to_vec(&throws)?)
            .with_context(|| path.display().to_string())?;
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(target) = arguments.at {
        return throw_at(target, robot, arguments);
    }
    let defaults = ThrowBenchConfig::default();
    let bench = ThrowBench {
        config: ThrowBenchConfig {
            height: arguments.height.unwrap_or(defaults.height),
            wheels: arguments.wheels,
            ..defaults
        },
        robot,
        world: super::world(arguments.world.as_deref())?,
        timing: ChainDelays::ours(),
        throws,
        seed: arguments.seed,
    };
    let report = bench.run(saying(u64::from(arguments.throws)))?;
    if arguments.json {
        output::print_json(&report)?;
    } else {
        print(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn throw_at(target: [f64; 3], robot: Robot, arguments: &ThrowArgs) -> anyhow::Result<ExitCode> {
    let aim = ThrowAim {
        robot,
        world: super::world(arguments.world.as_deref())?,
        timing: ChainDelays::ours(),
        wheels: arguments.wheels,
        target,
        beside: hands(&arguments.aim_beside)?,
        practice: usize::from(arguments.practice),
        // Both hands throw.
        throws: (arguments.throws as usize).max(ARMS),
        seed: arguments.seed,
    };
    let rounds = u64::from(arguments.practice) + 1;
    let report = aim.run(saying(u64::from(arguments.throws) * rounds))?;
    if arguments.json {
        output::print_json(&report)?;
    } else {
        print_aim(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns what the left and the right hand aim beside a target, from offsets as they are given.
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

/// Says now and then how many throws of all are done.
fn saying(all: u64) -> impl Fn() + Sync {
    let begun = Instant::now();
    let (done, said) = (AtomicU64::new(0), AtomicU64::new(2));
    move || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        let (elapsed, next) = (begun.elapsed(), said.load(Ordering::Relaxed));
        if elapsed.as_secs() >= next
            && said
                .compare_exchange(next, next + 2, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok()
        {
            let left = elapsed.mul_f64(all.saturating_sub(done) as f64 / done as f64);
            say!("{done} of {all} throws, {} to go", about(left));
        }
    }
}

fn print_aim(report: &ThrowAimReport) -> anyhow::Result<()> {
    for (number, round) in report.rounds.iter().enumerate() {
        output::print(format_args!(
            "round {}: {:.0} mm beside the target, 95 % below {:.0}, farthest {:.0}; {} throws",
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
        "fingers that open 2 ms early or late: {:.0} mm nearer, {:.0} mm elsewhere",
        report.distance_lost_mm_at_2ms, report.displaced_mm_at_2ms
    ))?;
    let speeds: Vec<String> = report
        .speed_by_joint_m_s
        .iter()
        .map(|speed| format!("{speed:.2}"))
        .collect();
    output::print(format_args!(
        "of the planned speed by joint (the turn, then the arm), m/s: {}",
        speeds.join(", ")
    ))?;
    let joints: Vec<String> = report.at_limit.iter().map(ToString::to_string).collect();
    output::print(format_args!(
        "joints at their greatest speed (0 the turn, 1 to 7 the arm): {}",
        joints.join(", ")
    ))?;
    let torques: Vec<String> = report
        .torques_nm
        .iter()
        .map(|torque| format!("{torque:.0}"))
        .collect();
    output::print(format_args!("greatest torques, Nm: {}", torques.join(", ")))?;
    if let Some(times) = report.plan_ms {
        output::print(format_args!(
            "planning: median {:.0} ms, longest {:.0} ms",
            times.p50, times.max
        ))?;
    }
    output::print("planned with other speeds:")?;
    for row in &report.speeds {
        output::print(format_args!(
            "  arm joints at least {:3.0} deg/s, turn {:3.0} deg/s: {:.2} m, {:.2} m/s",
            row.arm_deg_s, row.turn_deg_s, row.planned_m, row.speed_m_s
        ))?;
    }
    let goal = &report.goal;
    let arm = goal
        .arm_times
        .map(|times| format!("the arm {times:.2} times as fast"));
    let turn = goal
        .turn_deg_s
        .map(|speed| format!("the turn with {speed:.0} deg/s"));
    let takes: Vec<String> = arm.into_iter().chain(turn).collect();
    output::print(format_args!(
        "planned flights of {} m take {}",
        goal.goal_m,
        if takes.is_empty() {
            "more than three times the speeds".into()
        } else {
            takes.join(", or ")
        }
    ))
}
