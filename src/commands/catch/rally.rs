//! `tactnet catch rally`: two robots play catch.

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context;
use clap::Args;
use tactnet_catching_trials::{Rally, RallyConfig, RallyReport, rally_page};

use super::throw_progress::every_two_seconds;
use super::viewer::ViewerArgs;
use crate::output::{self, OutputFormat};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet catch rally --rallies 10 --seed 1 --json\n  \
    tactnet catch rally --rallies 10 --most 20 --page rally.html     flights, games by length, misses\n  \
    tactnet catch rally --rallies 4 --distance 5.2 --most 20\n  \
    tactnet catch rally --rallies 4 --distance 6.6 --wheels 0.4      the platform turns in throws\n  \
    tactnet catch rally --settings rally.json                        where balls come down, practice, the planner of throws")]
pub struct RallyArgs {
    /// Number of games; a game ends with the first missed ball
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    rallies: u32,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Distance between the robots, in m [default: 5]
    #[arg(long, value_name = "M")]
    distance: Option<f64>,
    /// Distance of the wheels from the centre of the platform, which turns in throws, in m [default: the vertical
    /// axis of the torso turns]
    #[arg(long, value_name = "M")]
    wheels: Option<f64>,
    /// Maximum number of catches per game [default: 100]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    most: Option<u32>,
    /// Settings of the games as JSON [default: built-in]
    #[arg(long, value_name = "FILE")]
    settings: Option<PathBuf>,
    /// Description of both robots [default: built-in]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Settings of their worlds as JSON [default: built-in]
    #[arg(long, value_name = "FILE")]
    world: Option<PathBuf>,
    /// Write an HTML page with flights, lengths of games and misses
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    #[command(flatten)]
    viewer: ViewerArgs,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(arguments: &RallyArgs) -> anyhow::Result<ExitCode> {
    let mut config = match &arguments.settings {
        Some(path) => {
            let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
            serde_json::from_str(&text).with_context(|| path.display().to_string())?
        }
        None => RallyConfig::default(),
    };
    config.distance = arguments.distance.unwrap_or(config.distance);
    config.wheels = arguments.wheels.or(config.wheels);
    config.most = arguments.most.map_or(config.most, |most| most as usize);
    let most = config.most as u64;
    arguments.viewer.check()?;
    if let Some(page) = &arguments.page {
        super::check_folder(page)?;
    }
    let rally = Rally {
        config,
        robot: super::robot(arguments.robot.as_ref())?,
        world: super::world(arguments.world.as_deref())?,
        rallies: arguments.rallies as usize,
        seed: arguments.seed,
    };
    // Games end at the first missed ball, so this is the maximum of the remaining throws.
    let all = u64::from(arguments.rallies) * most;
    let report = rally.run(every_two_seconds(all, |thrown, left| {
        say!("{thrown} throws, at most {left} to go");
    }))?;
    if let Some(path) = &arguments.page {
        std::fs::write(path, rally_page(&report)).with_context(|| path.display().to_string())?;
    }
    #[cfg(feature = "rerun")]
    if let Some(target) = arguments.viewer.target() {
        super::view_rally::view(&report, &target)?;
    }
    OutputFormat::from_flag(arguments.json).report(&report, print)
}

fn print(report: &RallyReport) -> anyhow::Result<()> {
    output::print(format_args!(
        "{} games at {} m: longest {} catches in a row, mean {:.1}",
        report.rallies, report.between_m, report.longest, report.mean
    ))?;
    output::print(format_args!(
        "{} of {} throws caught: {:.1} % [{:.1}, {:.1}]; of those that can be: {} of {}",
        report.catches,
        report.throws,
        100.0 * report.rate,
        100.0 * report.ci95_low,
        100.0 * report.ci95_high,
        report.caught_in_catch_space,
        report.in_catch_space
    ))?;
    if let (Some(distance), Some(lost), Some(displaced), Some(beside)) = (
        report.distance_m,
        report.distance_lost_mm_at_2ms,
        report.displaced_mm_at_2ms,
        report.beside_mm_rms,
    ) {
        output::print(format_args!(
            "flights of {distance:.2} m, {beside:.0} mm beside the target (root mean square)"
        ))?;
        output::print(format_args!(
            "fingers that open 2 ms early or late: {lost:.0} mm nearer, {displaced:.0} mm elsewhere"
        ))?;
    }
    for (cause, times) in &report.causes {
        output::print(format_args!("missed, {cause}: {times}"))?;
    }
    for (cause, times) in &report.no_throw_causes {
        output::print(format_args!("no throw, {cause}: {times}"))?;
    }
    Ok(())
}
