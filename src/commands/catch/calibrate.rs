//! `tactnet catch calibrate`: calibration of the robot's geometry.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use tactnet_catching::Robot;
use tactnet_catching::calibrate::{CalibrationConfig, KeptCalibration, Model, RoutineConfig};
use tactnet_catching_stage::recorded::{read_session, write_session};
use tactnet_catching_trials::{
    CalibrationReport, CalibrationTrial, FeatureReport, Progress, SolveReport, calibration_page,
    keep_calibration,
};
use tactnet_catching_world::{PlantedErrors, WorldConfig};

use super::throw_progress::throw_progress;
use super::viewer::ViewerArgs;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch calibrate --simulate --seed 7 --json\n  \
    tactnet catch calibrate --simulate --page calibration.html                   hands, markers and balls, before and after\n  \
    tactnet catch calibrate --simulate --record session.mcap --out calibration.toml --throws 0\n  \
    tactnet catch calibrate --from session.mcap --out calibration.toml           again, from the recording\n  \
    tactnet catch throw-series --planted 1 --calibration calibration.toml         catch with it, in stepped time\n  \
    tactnet catch run --planted 1 --calibration calibration.toml                  catch with it, live\n\n\
    With `--simulate`, the arms of a simulated robot with planted errors (those of robot number SEED, unless `--world` has others) move \
    through configurations chosen from random ones. The hands are then compared with the truth in held-out poses, and balls are thrown \
    before and after. If the calibration fails, FILE of `--out` does not change.")]
pub struct CalibrateArgs {
    /// Calibrate the simulated robot
    #[arg(long, required_unless_present = "from", conflicts_with = "from")]
    simulate: bool,
    /// Calibrate from a recorded session
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Seed of planted errors, noise, configurations and throws
    #[arg(long, value_name = "N", default_value_t = 1, conflicts_with = "from")]
    seed: u64,
    /// Number of configurations per arm
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u16).range(5..=200), conflicts_with = "from")]
    configurations: u16,
    /// Number of throws before and after the calibration each; 0 for none
    #[arg(long, value_name = "N", default_value_t = 200, value_parser = clap::value_parser!(u64).range(0..=1_000_000), conflicts_with = "from")]
    throws: u64,
    /// Description of the robot [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Settings of the world as JSON, including planted errors [default: built-in, with errors of up to about 60 mm
    /// at the hands]
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    world: Option<PathBuf>,
    /// Render the camera pictures and detect the markers in them (several minutes)
    #[arg(long, conflicts_with = "from")]
    pixels: bool,
    /// Record the session to a new MCAP file
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    record: Option<PathBuf>,
    /// Write the calibration to this TOML file; with `--from`, an existing one is the starting point of the solver
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Write an HTML page with hands, markers and catch rates before and after
    #[arg(long, value_name = "FILE", conflicts_with = "from")]
    page: Option<PathBuf>,
    #[command(flatten)]
    viewer: ViewerArgs,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Returns the robot's calibration from a file, if one is named.
pub fn calibration(path: Option<&Path>, robot: &Robot) -> anyhow::Result<Option<KeptCalibration>> {
    let Some(path) = path else {
        return Ok(None);
    };
    let bytes = std::fs::read(path).with_context(|| path.display().to_string())?;
    // Bytes that are not text fail in `parse`, whose error names the line.
    let kept = KeptCalibration::parse(&String::from_utf8_lossy(&bytes), robot.description())
        .with_context(|| path.display().to_string())?;
    Ok(Some(kept))
}

/// Runs the command.
pub fn run(arguments: &CalibrateArgs) -> anyhow::Result<ExitCode> {
    match &arguments.from {
        Some(path) => solve(arguments, path),
        None => simulate(arguments),
    }
}

fn solve(arguments: &CalibrateArgs, path: &Path) -> anyhow::Result<ExitCode> {
    let robot = super::robot(arguments.robot.as_ref())?;
    let session = read_session(path)?;
    let config = CalibrationConfig::default();
    let last = calibration(arguments.out.as_deref().filter(|out| out.exists()), &robot)?;
    let model = Model::new(&robot);
    let (report, _) = SolveReport::new(
        &model,
        &config,
        &session,
        last.as_ref().map(|last| &last.parameters),
    )?;
    if let Some(out) = &arguments.out {
        keep_calibration(out, &report.kept)?;
    }
    OutputFormat::from_flag(arguments.json).report(&report, print_solved)
}

fn simulate(arguments: &CalibrateArgs) -> anyhow::Result<ExitCode> {
    arguments.viewer.check()?;
    if let Some(page) = &arguments.page {
        super::check_folder(page)?;
    }
    let mut world = match arguments.world.as_deref() {
        Some(path) => super::world(Some(path))?,
        None => WorldConfig {
            errors: PlantedErrors::uncalibrated(arguments.seed),
            ..WorldConfig::default()
        },
    };
    world.pictures.markers |= arguments.pixels;
    let trial = CalibrationTrial {
        robot: super::robot(arguments.robot.as_ref())?,
        world,
        config: CalibrationConfig::default(),
        routine: RoutineConfig::default(),
        seed: arguments.seed,
        of_each_arm: arguments.configurations.into(),
        candidates: 500usize.max(4 * usize::from(arguments.configurations)),
        unseen: 200,
        throws: arguments.throws,
    };
    let thrown = throw_progress(2 * arguments.throws);
    let report = trial.run(|progress| match progress {
        Progress::Choosing => say!("choosing configurations"),
        Progress::Moving => say!("simulating the session"),
        Progress::Solving => say!("solving"),
        Progress::Throwing => thrown(),
    })?;
    if let Some(path) = &arguments.record {
        write_session(path, &report.session)?;
    }
    if let Some(out) = &arguments.out {
        keep_calibration(out, &report.solved.kept)?;
    }
    if let Some(path) = &arguments.page {
        std::fs::write(path, calibration_page(&report))
            .with_context(|| path.display().to_string())?;
    }
    #[cfg(feature = "rerun")]
    if let Some(target) = arguments.viewer.target() {
        super::view_calibration::view(&report, &target)?;
    }
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &CalibrationReport) -> anyhow::Result<()> {
    print_solved(&report.solved)?;
    let FeatureReport {
        shown,
        found,
        missed,
        wrong,
        ..
    } = report.detected;
    output::print(format_args!(
        "features: {found} of {shown} whole markers found, {missed} missed, {wrong} false; {:.2} px off (median, 95 % below {:.2})",
        report.detected.error_px_median, report.detected.error_px_p95
    ))?;
    output::print(format_args!(
        "hands at {} unseen poses, seen from both cameras: {:.1} mm off before, {:.1} mm at the worst; {:.2} mm after, {:.2} mm at the worst",
        report.unseen, report.raw.mean_mm, report.raw.worst_mm, report.mean_mm, report.worst_mm
    ))?;
    output::print(format_args!(
        "chosen from {} random configurations: log det {:.0}, of as many drawn ones {:.0}; those leave {:.2} mm, {:.2} mm at the worst",
        report.candidates,
        report.log_det,
        report.random.log_det,
        report.random.mean_mm,
        report.random.worst_mm
    ))?;
    for (name, rate, interval, misses) in [
        (
            "before",
            report.catch_rate_before,
            report.catch_rate_before_ci95,
            &report.misses_before,
        ),
        (
            "after",
            report.catch_rate_after,
            report.catch_rate_after_ci95,
            &report.misses_after,
        ),
    ] {
        if let (Some(rate), Some([low, high])) = (rate, interval) {
            output::print(format_args!(
                "caught {name}: {:.1} % [{:.1}, {:.1}] of {} balls in the catch space",
                100.0 * rate,
                100.0 * low,
                100.0 * high,
                report.in_catch_space
            ))?;
        }
        for (cause, count) in misses {
            output::print(format_args!("  missed {name}, {cause}: {count}"))?;
        }
    }
    Ok(())
}

fn print_solved(report: &SolveReport) -> anyhow::Result<()> {
    output::print(format_args!(
        "{} configurations, {} features, {:.0} s of the robot's time; solved in {:.2} s, {} iterations",
        report.configurations,
        report.features,
        report.robot_seconds,
        report.solve_seconds,
        report.iterations
    ))?;
    output::print(format_args!(
        "features fall {:.2} times the expected noise from where they should, {:.1} % of them are something else",
        report.fit,
        100.0 * report.outlying
    ))?;
    for direction in report.worst_determined.iter().take(3) {
        let parts: Vec<String> = direction
            .unknowns
            .iter()
            .map(|(name, part)| format!("{part:+.2} {name}"))
            .collect();
        output::print(format_args!(
            "hardly determined, {:.3} of what was known before: {}",
            direction.left,
            parts.join("; ")
        ))?;
    }
    Ok(())
}
