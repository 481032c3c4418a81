//! `tactnet catch run`: the whole stack on channels, live in the simulated world.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_catching::track::CLUTTER_OF_PICTURES;
use tactnet_catching_packets::packets::{CalibrationState, CatchOutcome, ThrownBack};
use tactnet_catching_roles::{Milliseconds, RoleSettings};
use tactnet_catching_stage::{
    CatchRun, Feel, HeldReport, RunEvent, RunReport, SlipAt, ThrowBackReport, WorldSettings,
};
use tactnet_catching_world::TendonSlip;
use tactnet_pipeline::RunDir;

use super::place::place;
use super::skin::SkinSettings;
use crate::stop::Stop;
use crate::{GIT, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch run --throws 10             ten throws, a line for each\n  \
    tactnet catch run --seconds 60 --json     a minute, with times of every process\n  \
    tactnet catch run --pixels                from pictures: wants more than two cores\n  \
    tactnet catch run --throws 10 --record run.mcap     and keep every packet\n  \
    tactnet catch run --throws 10 --feel runs/a         and feel what the caught balls are made of\n  \
    tactnet catch run --throws 10 --throw-back          and throw them back; `--throw-back=4,0,1.2`: to there\n  \
    tactnet catch run --throws 10 --planted 7           a robot that is not as described, and what it catches so\n  \
    tactnet catch run --throws 10 --planted 7 --calibration calibration.toml     with what `catch calibrate --simulate --seed 7 --out calibration.toml` found\n  \
    tactnet catch run --throws 20 --planted 7 --calibration calibration.toml --slip-at 8     a tendon slips on the way\n\n\
    Every part is a process: world, pose, tracker, coordinator, two planners, controller, safety, hand (and eyes, with --pixels; thrower, with --throw-back; slip-watch, with --calibration). One that \
    ends by itself brakes the robot, is named and begins again. Ctrl-C ends all of them.")]
pub struct RunArgs {
    /// Number of throws after which the run ends [default: unlimited]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    throws: Option<u64>,
    /// Time after which the run ends, in s [default: unlimited]
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<f64>,
    /// Seed of all random numbers of the world
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Number of balls per throw
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    balls: u8,
    /// Render pictures and detect circles in them; otherwise circles come from the world, with noise, misses and
    /// clutter
    #[arg(long)]
    pixels: bool,
    /// Run directory of a network that predicts the material of caught balls: the free hand sweeps over the ball up
    /// to three times
    #[arg(long, value_name = "DIR", conflicts_with = "pixels")]
    feel: Option<PathBuf>,
    /// Data set with the sweeps of the materials [default: those of the run's data that were not used for training]
    #[arg(long, value_name = "FILE|twin", requires = "feel")]
    data: Option<String>,
    /// Throw caught balls back: to their origin, as far as the robot can, or to a target in m (x ahead, y left, z up)
    #[arg(long, value_name = "X,Y,Z", num_args = 0..=1, require_equals = true, value_parser = place)]
    throw_back: Option<Option<[f64; 3]>>,
    /// Offset of the aim from the target, in m, as learnt by `catch throw`; once for both hands, or for the left and
    /// then the right hand
    #[arg(long, value_name = "DX,DY,DZ", requires = "throw_back", allow_hyphen_values = true, value_parser = place)]
    aim_beside: Vec<[f64; 3]>,
    /// Number of planners of each arm, each a process; they share the search of a first plan and correct it in turns
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = super::planners)]
    planners: u32,
    /// Let the self-collision monitor report instead of brake
    #[arg(long)]
    watch: bool,
    /// Run the world and the 1 kHz loops under SCHED_FIFO with this priority
    #[arg(long, value_name = "P", value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Description of the robot [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Settings of the world as JSON [default: built-in]
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
    /// Calibration from `catch calibrate` that corrects measurements and commands
    #[arg(long, value_name = "FILE", conflicts_with = "pixels")]
    calibration: Option<PathBuf>,
    /// Plant the errors of the uncalibrated robot with this number, as in `catch calibrate --simulate --seed N`;
    /// replaces the errors of `--world`
    #[arg(long, value_name = "N")]
    planted: Option<u64>,
    /// Number of the throw before which a tendon of the right arm slips: its second joint moves by a degree without a
    /// change of its sensor
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    slip_at: Option<u64>,
    /// Record all channels except pictures to an MCAP file, for `catch timing` and `catch replay`
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Tendon slip of `--slip-at`.
const SLIP: TendonSlip = TendonSlip {
    arm: 1,
    joint: 1,
    angle: 0.0175,
};

fn seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected seconds".to_string())?;
    if seconds > 0.0 && seconds <= 1e6 {
        Ok(seconds)
    } else {
        Err("expected seconds greater than 0, at most 1000000".into())
    }
}

fn absolute(path: Option<&PathBuf>) -> std::io::Result<Option<PathBuf>> {
    path.map(std::path::absolute).transpose()
}

/// Runs the command.
pub fn run(arguments: &RunArgs) -> anyhow::Result<ExitCode> {
    let stack = stack(arguments)?;
    if arguments.feel.is_some() && arguments.balls > 1 {
        bail!("--feel: with two balls no hand is free; expected `--balls 1`");
    }
    let felt = arguments
        .feel
        .as_ref()
        .map(|run| felt(run, arguments))
        .transpose()?;
    let world = world(arguments, felt.as_ref())?;
    if let Some(path) = arguments.record.as_ref().filter(|path| path.exists()) {
        bail!(
            "{}: exists already; name another file with `--record`",
            path.display()
        );
    }
    let stop = Stop::listen_saying("stopping")?;
    let folder = tempfile::tempdir()?;
    let program = std::env::current_exe()?;
    let run = CatchRun {
        program: &program,
        folder: folder.path(),
        stack,
        world,
        feel: match (&arguments.feel, &felt) {
            (Some(run), Some(felt)) => Some(Feel {
                run,
                skin: serde_json::to_string(felt)?,
            }),
            _ => None,
        },
        throws: arguments.throws,
        seconds: arguments.seconds,
        record: arguments.record.as_deref(),
        git: GIT,
        priority: arguments.priority,
    };
    let report = run.run(&mut show, &|| stop.asked())?;
    if arguments.json {
        output::print_json(&report)?;
    } else {
        print(&report, arguments.record.as_deref())?;
    }
    let broke_off = report.recording.and_then(|recording| recording.broke_off);
    if let Some(why) = broke_off {
        say!("the recording broke off: {why}");
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the settings of the stack. Invalid files are reported before the processes start.
fn stack(arguments: &RunArgs) -> anyhow::Result<RoleSettings> {
    let mut stack = RoleSettings {
        robot: absolute(arguments.robot.as_ref())?,
        calibration: absolute(arguments.calibration.as_ref())?,
        brakes: !arguments.watch,
        ..RoleSettings::default()
    };
    if arguments.pixels {
        stack.clutter = CLUTTER_OF_PICTURES;
    }
    // With two balls only the arms move, as in the thesis.
    stack.coordinator.lower_body = arguments.balls == 1;
    stack.coordinator.planners = arguments.planners;
    stack.throw.at = arguments.throw_back.flatten();
    stack.throw.beside = super::throw::hands(&arguments.aim_beside)?;
    stack.throw.after_feeling = arguments.feel.is_some();
    if arguments.throw_back.is_some() && arguments.balls > 1 {
        bail!("--throw-back: a hand throws one ball; expected `--balls 1`");
    }
    super::robot(arguments.robot.as_ref())?;
    stack.kept()?;
    Ok(stack)
}

fn world(arguments: &RunArgs, felt: Option<&SkinSettings>) -> anyhow::Result<WorldSettings> {
    Ok(WorldSettings {
        materials: felt.map_or_else(Vec::new, |felt| felt.materials.clone()),
        world: super::planted(arguments.world.as_deref(), arguments.planted)?,
        seed: arguments.seed,
        balls: usize::from(arguments.balls),
        throw_back: arguments.throw_back.is_some(),
        pixels: arguments.pixels,
        slip: arguments.slip_at.map(|throw| SlipAt {
            throw,
            tendon: SLIP,
        }),
        ..WorldSettings::default()
    })
}

/// Returns the settings of a skin with sweeps of all materials of a run.
fn felt(run: &Path, arguments: &RunArgs) -> anyhow::Result<SkinSettings> {
    let own = RunDir::open(run)?.config()?.spec.data;
    Ok(SkinSettings {
        run: run.into(),
        data: arguments.data.clone().unwrap_or(own),
        materials: felt_materials(run)?,
        seed: arguments.seed,
    })
}

/// Returns the materials that a network knows, which are those of the balls.
pub fn felt_materials(run: &Path) -> anyhow::Result<Vec<String>> {
    let config = RunDir::open(run)?.network("be served")?.config()?;
    Ok(config.classifier.labels.names().map(Into::into).collect())
}

/// Prints an event of a run.
pub fn show(event: RunEvent) {
    match event {
        RunEvent::Started(processes) => {
            let names: Vec<String> = processes
                .iter()
                .map(|(name, process)| format!("{name} {process}"))
                .collect();
            say!("started: {}", names.join(", "));
        }
        RunEvent::Thrown {
            throws,
            caught,
            outcome,
        } => {
            let became = if outcome.caught == 1 {
                let side = if outcome.arm == 0 { "left" } else { "right" };
                let (across, along) = (1e3 * outcome.across, 1e3 * outcome.along);
                format!(
                    "caught, {side} hand, {across:.1} mm beside its middle, closed {along:+.1} ms"
                )
            } else {
                format!("missed: {}", tactnet_catching_stage::cause(outcome.cause))
            };
            let note = if outcome.arms == 0 {
                " (out of the catch space)"
            } else {
                ""
            };
            let felt = feeling(&outcome);
            say!("throw {throws}: {became}{note}{felt}; {caught} of {throws} caught");
        }
        RunEvent::ThrownBack(thrown) => say!("{}", thrown_back(&thrown)),
        RunEvent::NotThrown(why) => say!("not thrown back: {why}"),
        RunEvent::NoLongerCalibrated(state) => say!("{NO_LONGER} ({})", squares_of(&state)),
        RunEvent::Ended { name, said, brakes } => {
            let why = if said.is_empty() {
                String::new()
            } else {
                format!(": {said}")
            };
            let brakes = if brakes { "; the robot brakes" } else { "" };
            say!("the {name} has ended{why}{brakes}");
        }
        RunEvent::Restarted { name, process } => say!("the {name} begins again, process {process}"),
        RunEvent::Braked(why) => say!("brakes: {why}"),
    }
}

/// Instruction for an invalid calibration.
const NO_LONGER: &str = "the calibration no longer holds: run `tactnet catch calibrate`";

fn squares_of(state: &CalibrationState) -> String {
    let means = state.mean_square.map(|mean| (mean > 0.0).then_some(mean));
    squares(means, state.innovations)
}

/// Describes the mean squared innovations of the markers.
fn squares(means: [Option<f64>; 2], features: [u64; 2]) -> String {
    let of = |arm: usize| {
        let side = ["left", "right"][arm];
        means[arm].map_or_else(
            || format!("{side} marker not seen"),
            |mean| format!("{side} marker {mean:.1} of {} features", features[arm]),
        )
    };
    format!(
        "mean square of the last features, in their expected spread, where 2 is right: {}, {}",
        of(0),
        of(1)
    )
}

fn held(report: &HeldReport) -> String {
    let squares = squares(report.mean_square, report.innovations);
    match report.holds {
        Some(true) => format!("the calibration {} holds ({squares})", report.identity),
        Some(false) => format!("{NO_LONGER} ({squares})"),
        None => format!(
            "whether the calibration {} holds is not known: too little was seen of the markers ({squares})",
            report.identity
        ),
    }
}

fn thrown_back(thrown: &ThrownBack) -> String {
    let side = if thrown.arm == 0 { "left" } else { "right" };
    format!(
        "thrown back {}: {side} hand, {:.2} m far, {:.0} mm beside its target",
        thrown.number,
        thrown.length,
        1e3 * thrown.miss
    )
}

/// Describes the predicted material, after the outcome of the throw.
fn feeling(outcome: &CatchOutcome) -> String {
    let (material, felt) = (outcome.material.as_str(), outcome.felt.as_str());
    if material.is_empty() {
        return String::new();
    }
    if felt.is_empty() {
        return format!("; of {material}, which was not felt");
    }
    let truth = if felt == material {
        "right".into()
    } else {
        format!("it is {material}")
    };
    let (sweeps, sure) = (outcome.sweeps, 100.0 * outcome.posterior);
    let plural = if sweeps == 1 { "" } else { "s" };
    format!("; feels like {felt}, {sure:.1} % after {sweeps} sweep{plural} ({truth})")
}

fn print(report: &RunReport, file: Option<&Path>) -> anyhow::Result<()> {
    let counts = &report.counts;
    let rate = counts.rate.map_or_else(
        || "no ball could have been caught".to_string(),
        |rate| {
            format!(
                "{} of {} balls that could be caught, {:.1} [{:.1}, {:.1}] %",
                counts.caught,
                counts.catchable,
                100.0 * rate,
                100.0 * counts.ci95_low,
                100.0 * counts.ci95_high
            )
        },
    );
    output::print(format_args!(
        "{rate}; {} of all {} thrown",
        counts.caught_of_all, report.balls
    ))?;
    if let Some(pairs) = report.pairs {
        output::print(format_args!(
            "pairs: both caught in {} of {} throws in which both could be, [{:.1}, {:.1}] %; in {} of all {}",
            pairs.counts.caught,
            pairs.counts.catchable,
            100.0 * pairs.counts.ci95_low,
            100.0 * pairs.counts.ci95_high,
            pairs.counts.caught_of_all,
            pairs.thrown
        ))?;
    }
    if let Some(sweeps) = report.sweeps_a_ball {
        output::print(format_args!(
            "materials: {} of {} balls felt right, after {sweeps:.1} sweeps each",
            report.correct_materials, report.beliefs_after_catch
        ))?;
    }
    if let Some(report) = &report.calibration {
        output::print(held(report))?;
    }
    if let Some(throws) = &report.throw_back {
        print_throws(throws)?;
    }
    print_times(report)?;
    if let (Some(recording), Some(path)) = (&report.recording, file) {
        output::print(format_args!(
            "{}: {} packets, {} lost; `tactnet catch timing {0}` draws what takes how long",
            path.display(),
            recording.messages,
            recording.lost
        ))?;
    }
    Ok(())
}

/// Prints delays and the outcome of the safety monitor.
fn print_times(report: &RunReport) -> anyhow::Result<()> {
    let times = |name: &str, times: Option<Milliseconds>| {
        times.map_or(format!("{name}: none"), |t| {
            format!(
                "{name}: {:.1} ms, 99 % below {:.1}, longest {:.1}",
                t.p50, t.p99, t.max
            )
        })
    };
    output::print(times("exposure to path", report.exposure_to_path_ms))?;
    output::print(times(
        "age of the last picture at a catch",
        report.last_picture_age_ms,
    ))?;
    output::print(times(
        "age of the last pose of the head at a catch",
        report.last_measurement_age_ms,
    ))?;
    output::print(format_args!(
        "1 kHz loop: 99.9 % of commands within {:.0} us of their beat; brakes by the monitor: {}, {} of them false stops",
        report.loop_p999_us, report.monitor_brakes, report.false_brakes
    ))
}

fn print_throws(report: &ThrowBackReport) -> anyhow::Result<()> {
    let misses = report.throw_miss_mm.map_or_else(String::new, |miss| {
        format!(
            ", {:.0} mm beside their targets, 95 % below {:.0}, farthest {:.0}",
            miss.p50, miss.p95, miss.max
        )
    });
    output::print(format_args!("thrown back: {}{misses}", report.throws_back))?;
    for (side, beside) in ["left", "right"].iter().zip(report.throw_beside_mm) {
        if let Some([x, y]) = beside {
            output::print(format_args!(
                "  {side} hand: {x:+.0} mm ahead and {y:+.0} mm to the left of them, on average"
            ))?;
        }
    }
    for (why, times) in &report.throws_failed {
        output::print(format_args!("  not thrown: {why}, {times} times"))?;
    }
    Ok(())
}
