//! `tactnet simulate skin`: sends sweeps of a data set on the skin's channel in real time.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anyhow::bail;
use clap::Args;
use tactnet_channel::{Bus, Domain, ListedChannel, Start, Table, Wait, list_channels};
use tactnet_data::{Dataset, Seed};
use tactnet_pipeline::{LabelOrder, RunDir, write_whole};
use tactnet_simulation::{PlayCycle, SkinDriver, SkinSimulator, play_order, rest_frames};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::ModelNames;

use super::fault::FaultArgs;
use super::{check_fit, unseen_by};
use crate::commands::choices::rate;
use crate::stop::Stop;
use crate::table;
use crate::{output, source};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet simulate skin --table robot.toml                             all materials of the twin, in random order\n  \
    tactnet simulate skin --table robot.toml --data sweeps.h5 --sweeps 5 five sweeps of a recorded data set\n  \
    tactnet simulate skin --table robot.toml --taxel-order transposed    a skin whose rows and columns are exchanged")]
pub struct SkinArgs {
    /// Channel table; `tactnet serve --print-table` prints one
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Data set of the sweeps [default: twin; with --unseen-by, the run's data set]
    #[arg(long, value_name = "FILE|twin")]
    data: Option<String>,
    /// Sample rate, in Hz; takes precedence over that of the data [default: with --unseen-by, the run's setting]
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Run directory: play only sweeps that this run was not trained on, with its sample rate and number of steps
    #[arg(long, value_name = "DIR")]
    unseen_by: Option<PathBuf>,
    /// Number of consecutive sweeps of one object; a reset follows each object; `none` disables resets [default: 3, or
    /// the smallest number of sweeps per material]
    #[arg(long, value_name = "N|none", value_parser = object_sweeps)]
    sweeps_per_object: Option<u64>,
    /// Materials to play, in turns [default: all, in random order]
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    materials: Vec<String>,
    /// Number of sweeps to play [default: until Ctrl-C]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    sweeps: Option<u64>,
    /// Speed relative to real time; frames are lost if it is too fast for the classifier
    #[arg(long, value_name = "N", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// Write the cycle of sweeps to this file before `ready`, for `tactnet demo`
    #[arg(long, value_name = "FILE", hide = true)]
    cycle_out: Option<PathBuf>,
    /// Send only frames; start, stop and reset come from elsewhere (`tactnet channel command`)
    #[arg(long)]
    no_commands: bool,
    /// Seed of the order of the sweeps
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    fault: FaultArgs,
}

/// Timeout for the names of a serving network.
const SERVICE: Wait = Wait::Block {
    timeout: Duration::from_millis(500),
};

/// Default number of sweeps per object.
const OBJECT_SWEEPS: u64 = 3;

/// Parses the number of sweeps per object; 0 means that no command marks a new object.
fn object_sweeps(text: &str) -> Result<u64, String> {
    match text.parse() {
        Ok(sweeps @ 0..=1000) => Ok(sweeps),
        _ if text == "none" => Ok(0),
        _ => Err("expected 1 to 1000 sweeps, or `none`".into()),
    }
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(speed) if speed > 0.0 && speed <= 1000.0 => Ok(speed),
        _ => Err("expected a number above 0, at most 1000".into()),
    }
}

/// Refuses frames that do not fit the network that serves on this table, if there is one.
fn refuse_another_skin(
    bus: &Bus,
    table: &Table,
    config: &ServeConfig,
    dataset: &Dataset,
) -> anyhow::Result<()> {
    let listed = list_channels(bus, table)?;
    let is_served = |channel: &ListedChannel| channel.id == config.model && channel.put_ports > 0;
    if !listed.iter().any(is_served) {
        return Ok(());
    }
    let models = bus.get_port::<ModelNames>(config.model.as_str(), Start::History(1))?;
    // A service sends its newest packet to late subscribers at its next tick.
    let Some(packet) = models.get(SERVICE)? else {
        return Ok(());
    };
    let Some(network) = packet.first() else {
        return Ok(());
    };
    let (own, rate_hz) = (dataset.shape(), dataset.sample_rate_hz());
    let taxels = network.rows as usize * network.cols as usize;
    if own.taxels() != taxels || (rate_hz / network.sample_rate_hz - 1.0).abs() > 1e-3 {
        bail!(
            "the serving network expects {}x{} taxels at {} Hz, these sweeps have {}x{} at {rate_hz} Hz",
            network.rows,
            network.cols,
            network.sample_rate_hz,
            own.rows,
            own.cols
        );
    }
    Ok(())
}

/// Returns the data set with the indices of the sweeps that may be played.
fn load_sweeps(arguments: &SkinArgs) -> anyhow::Result<(Dataset, Vec<usize>)> {
    match &arguments.unseen_by {
        Some(run) => {
            // Sample rate and number of steps are the run's.
            let config = RunDir::open(run)?.config()?;
            let mut spec = config.spec.clone();
            let data = config.spec.place_of_data(arguments.data.as_deref())?;
            spec.name_rate_of(data, arguments.rate);
            let dataset = source::load_as(&spec, data, LabelOrder::True)?;
            check_fit(&dataset, data, &config.classifier)?;
            let unseen = unseen_by(&dataset, run)?;
            Ok((dataset, unseen))
        }
        None => {
            let dataset = source::load(arguments.data.as_deref().unwrap_or("twin"))?
                .with_named_rate(arguments.rate)?;
            let all = (0..dataset.len()).collect();
            Ok((dataset, all))
        }
    }
}

/// Returns the number of sweeps per object and the order in which sweeps are played.
fn play_plan(
    arguments: &SkinArgs,
    dataset: &Dataset,
    sweeps: &[usize],
) -> anyhow::Result<(u64, Vec<usize>)> {
    let order_of = |object_sweeps: u64| -> anyhow::Result<Vec<usize>> {
        let (materials, seed) = (&arguments.materials, Seed(arguments.seed));
        let order = play_order(dataset, sweeps, materials, object_sweeps as usize, seed)?;
        Ok(order)
    };
    match arguments.sweeps_per_object {
        Some(sweeps) => Ok((sweeps, order_of(sweeps)?)),
        None => {
            let mut shorter = (2..=OBJECT_SWEEPS).rev();
            let found = shorter.find_map(|sweeps| Some((sweeps, order_of(sweeps).ok()?)));
            match found {
                Some(found) => Ok(found),
                None => Ok((1, order_of(1)?)),
            }
        }
    }
}

/// Plays the sweeps.
pub fn run(arguments: &SkinArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = table::load(&arguments.table)?;
    let config = ServeConfig::of(&table)?;
    // A missing hub is an error before sweeps are read or generated.
    let bus = Bus::open(Domain::Host, &table)?;
    let (dataset, sweeps) = load_sweeps(arguments)?;
    let (object_sweeps, order) = play_plan(arguments, &dataset, &sweeps)?;
    if let Some(path) = &arguments.cycle_out {
        let cycle = PlayCycle::of(order.len(), sweeps.len(), object_sweeps as usize);
        write_whole(path, serde_json::to_string(&cycle)?.as_bytes())?;
    }
    if dataset.is_rate_assumed() && arguments.rate.is_none() {
        say!(
            "warning: the sample rate of {} Hz is assumed, because the data does not state it; `--rate HZ` sets it",
            dataset.sample_rate_hz()
        );
    }
    let fault = arguments.fault.fault(dataset.shape().taxels())?;
    refuse_another_skin(&bus, &table, &config, &dataset)?;
    let mut driver = SkinDriver::open(&bus, &config)?.at_speed(arguments.speed);
    if arguments.no_commands {
        driver = driver.without_commands();
    }
    let rest = rest_frames(dataset.sample_rate_hz());
    let lead = config.segmenter.skip.frames(dataset.sample_rate_hz());
    let in_order = order.len() as u64;
    let mut skin = SkinSimulator::new(&dataset, order, lead, rest).with_fault(fault);
    if object_sweeps > 0 {
        skin = skin.with_objects_of(object_sweeps);
    }
    say!(
        "sending {} frames per second on {}; Ctrl-C ends",
        dataset.sample_rate_hz() * arguments.speed,
        config.fingers[0]
    );
    output::print(format_args!("ready"))?;
    let on_start = |skin: &SkinSimulator<'_>, motion: u64| {
        let sweep = skin.sweep_of(motion);
        let material = dataset.labels().name(dataset.records()[sweep].label);
        if motion == in_order + 1 {
            say!(
                "note: all {} were played; the sequence repeats",
                output::counted(in_order as usize, "sweep")
            );
        }
        output::print(format_args!("motion {motion}: sweep {sweep}, {material}"))
    };
    let sweeps = arguments.sweeps.unwrap_or(u64::MAX);
    let ended = |motions| stop.asked() || motions == sweeps;
    driver.run(&mut skin, on_start, &ended)?;
    Ok(ExitCode::SUCCESS)
}
