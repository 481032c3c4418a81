//! `tactnet simulate skin`: sweeps of a data set on the skin's channel in real time.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use tactnet_channel::{Bus, Domain, Table};
use tactnet_data::Seed;
use tactnet_rehearsal::{REST_FRAMES, SkinDriver, SkinSimulator, play_order};
use tactnet_skin::ServeConfig;

use super::unseen_by;
use crate::stop::Stop;
use crate::{output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet simulate skin --table robot.toml                             all materials of the twin at random\n  \
    tactnet simulate skin --table robot.toml --data sweeps.h5 --sweeps 5 five sweeps of a recorded data set")]
pub struct SkinArgs {
    /// The table of channels
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Whose sweeps
    #[arg(long, value_name = "FILE|twin", default_value = "twin")]
    data: String,
    /// Only sweeps that this run was not trained on
    #[arg(long, value_name = "DIR")]
    unseen_by: Option<PathBuf>,
    /// Only these materials, in turns
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    materials: Vec<String>,
    /// End after N sweeps [default: go on]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    sweeps: Option<u64>,
    /// Decides the order of the sweeps
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Runs the command.
pub fn run(arguments: &SkinArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = Table::load(&arguments.table)?;
    let config = ServeConfig::of(&table)?;
    // Before sweeps are read or generated: without a hub that would be in vain.
    let bus = Bus::open(Domain::Host, &table)?;
    let dataset = source::load(&arguments.data)?;
    let sweeps = match &arguments.unseen_by {
        Some(run) => unseen_by(&dataset, run)?,
        None => (0..dataset.len()).collect(),
    };
    let order = play_order(
        &dataset,
        &sweeps,
        &arguments.materials,
        Seed(arguments.seed),
    )?;
    let driver = SkinDriver::open(&bus, &config)?;
    let mut skin = SkinSimulator::new(&dataset, order, config.segmenter.skip, REST_FRAMES);
    eprintln!(
        "putting {} frames a second on {}; Ctrl-C ends",
        dataset.sample_rate_hz(),
        config.fingers[0]
    );
    output::print(format_args!("ready"))?;
    let on_start = |skin: &SkinSimulator<'_>, motion: u64| {
        let sweep = skin.sweep_of(motion);
        let material = dataset.labels().name(dataset.records()[sweep].label);
        output::print(format_args!("motion {motion}: sweep {sweep}, {material}"))
    };
    let sweeps = arguments.sweeps.unwrap_or(u64::MAX);
    let ended = |motions| stop.asked() || motions == sweeps;
    driver.run(&mut skin, on_start, &ended)?;
    Ok(ExitCode::SUCCESS)
}
