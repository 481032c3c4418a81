//! `tactnet simulate`: what a robot would put on the channels, for people without one.

mod soak;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, bail};
use clap::{Args, Subcommand, ValueEnum};
use rand::seq::SliceRandom;
use tactnet_channel::{Bus, Domain, Priority, Table};
use tactnet_data::{Dataset, Seed};
use tactnet_pipeline::{RunDir, TestSweeps};
use tactnet_serving::packets::{SkinFrame, SweepCommand};
use tactnet_serving::simulate::{CatchingRole, SkinSimulator, Ticker, catching_table, run_role};
use tactnet_serving::{Realtime, ServeConfig};

use crate::stop::Stop;
use crate::{output, source};

/// Frames without contact between two motions, at 750 Hz half a second.
const REST: usize = 375;

#[derive(Subcommand)]
#[command(after_help = "Examples:\n  \
    tactnet simulate skin --table robot.toml --materials wood,cork     sweeps over wood and cork, in turns, in real time\n  \
    tactnet simulate catching --table robot.toml --seconds 10          cameras, tracker, planner and the 1 kHz loop beside it\n  \
    tactnet simulate soak --seconds 30 --run runs/a --json             all of it at once, measured")]
pub enum SimulateCommand {
    /// Put sweeps of a data set on the skin's channel in real time, with commands
    Skin(SkinArgs),
    /// Run the load of the ball catching stack (thesis, figure 3.2) and measure its 1 kHz loop
    Catching(CatchingArgs),
    /// Run hub, skin, catching stack, classifier and dashboard together and measure what they do to each other
    Soak(soak::SoakArgs),
}

/// Runs the command.
pub fn run(command: SimulateCommand) -> anyhow::Result<ExitCode> {
    match command {
        SimulateCommand::Skin(arguments) => skin(&arguments),
        SimulateCommand::Catching(arguments) => catching(&arguments),
        SimulateCommand::Soak(arguments) => soak::run(&arguments),
    }
}

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

/// Sweeps that a run was not trained on.
pub(crate) fn unseen_by(dataset: &Dataset, run: &Path) -> anyhow::Result<Vec<usize>> {
    let run = RunDir::open(run)?;
    let view = TestSweeps::unseen(dataset, &run.config()?, &run.split()?)?.view;
    Ok(view.indices().to_vec())
}

/// Sweeps of the materials in turns, each material's in random order.
///
/// - `sweeps`: those to choose from
pub(crate) fn order_of(
    dataset: &Dataset,
    sweeps: &[usize],
    materials: &[String],
    seed: Seed,
) -> anyhow::Result<Vec<usize>> {
    let names: Vec<&str> = dataset.labels().names().collect();
    let labels: Vec<usize> = if materials.is_empty() {
        (0..names.len()).collect()
    } else {
        materials
            .iter()
            .map(|material| {
                names
                    .iter()
                    .position(|name| name == material)
                    .with_context(|| {
                        format!("no material `{material}`; there are {}", names.join(", "))
                    })
            })
            .collect::<anyhow::Result<_>>()?
    };
    let mut sweeps: Vec<Vec<usize>> = labels
        .iter()
        .map(|label| {
            let own = sweeps.iter().copied();
            own.filter(|sweep| dataset.records()[*sweep].label == *label)
                .collect()
        })
        .collect();
    for (sweeps, label) in sweeps.iter_mut().zip(&labels) {
        sweeps.shuffle(&mut seed.rng(("simulated sweeps", *label)));
    }
    let rounds = sweeps.iter().map(Vec::len).min().unwrap_or(0);
    if rounds == 0 {
        bail!("a material without a sweep");
    }
    let mut order = Vec::with_capacity(rounds * labels.len());
    for round in 0..rounds {
        let mut turn: Vec<usize> = sweeps.iter().map(|sweeps| sweeps[round]).collect();
        if materials.is_empty() {
            turn.shuffle(&mut seed.rng(("simulated round", round)));
        }
        order.extend(turn);
    }
    Ok(order)
}

fn skin(arguments: &SkinArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    let table = Table::load(&arguments.table)?;
    let config = ServeConfig::of(&table)?;
    let dataset = source::load(&arguments.data)?;
    let sweeps = match &arguments.unseen_by {
        Some(run) => unseen_by(&dataset, run)?,
        None => (0..dataset.len()).collect(),
    };
    let order = order_of(
        &dataset,
        &sweeps,
        &arguments.materials,
        Seed(arguments.seed),
    )?;
    let bus = Bus::open(Domain::Host, &table)?;
    let frames = bus.put_port::<SkinFrame>(config.fingers[0].as_str(), Priority::High)?;
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
    let mut skin = SkinSimulator::new(&dataset, order, config.follow.skip, REST);
    eprintln!(
        "putting {} frames a second on {}; Ctrl-C ends",
        dataset.sample_rate_hz(),
        config.fingers[0]
    );
    output::print(format_args!("ready"))?;
    let mut ticker = Ticker::new(dataset.sample_rate_hz());
    while !stop.asked() {
        ticker.wait();
        let step = skin.step();
        if let Some(command) = step.command {
            commands.put_copy(&[command])?;
            let motion = skin.motions();
            let over = arguments.sweeps.is_some_and(|sweeps| motion == sweeps);
            if command.command() == Some(tactnet_serving::packets::Command::Start) {
                let sweep = skin.sweep_of(motion);
                let material = dataset.labels().name(dataset.records()[sweep].label);
                output::print(format_args!("motion {motion}: sweep {sweep}, {material}"))?;
            } else if over {
                break;
            }
        }
        frames.put_copy(&[step.frame])?;
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Args)]
pub struct CatchingArgs {
    /// The table of channels; the stack's own are those of `--print-table`
    #[arg(long, value_name = "FILE", required_unless_present = "print_table")]
    table: Option<PathBuf>,
    /// End after so many seconds [default: go on]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Run one process of the stack only
    #[arg(long, value_enum, hide = true)]
    role: Option<RoleChoice>,
    /// Run that process under SCHED_FIFO with this priority
    #[arg(long, hide = true, value_parser = clap::value_parser!(u8).range(1..=99))]
    priority: Option<u8>,
    /// Print a table with the stack's channels and the classifier's, and end
    #[arg(long)]
    print_table: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
pub enum RoleChoice {
    Sensors,
    Tracker,
    Planner,
    Drives,
    Controller,
}

impl RoleChoice {
    fn role(self) -> CatchingRole {
        match self {
            Self::Sensors => CatchingRole::Sensors,
            Self::Tracker => CatchingRole::Tracker,
            Self::Planner => CatchingRole::Planner,
            Self::Drives => CatchingRole::Drives,
            Self::Controller => CatchingRole::Controller,
        }
    }
}

fn catching(arguments: &CatchingArgs) -> anyhow::Result<ExitCode> {
    let Some(path) = &arguments.table else {
        let table = catching_table(ServeConfig::default().table("robot"));
        output::print(format_args!("{}", toml::to_string(&table)?.trim_end()))?;
        return Ok(ExitCode::SUCCESS);
    };
    let stop = Stop::listen_saying("stopping")?;
    if let Some(role) = arguments.role {
        let bus = Bus::open(Domain::Host, &Table::load(path)?)?;
        let asked = Arc::new(AtomicBool::new(false));
        let flag = asked.clone();
        std::thread::spawn(move || {
            while !stop.asked() {
                std::thread::sleep(std::time::Duration::from_millis(20));
            }
            flag.store(true, Ordering::Relaxed);
        });
        let realtime = Realtime {
            priority: arguments.priority,
            ..Realtime::default()
        };
        for line in realtime.apply() {
            eprintln!("{line}; going on without");
        }
        output::print(format_args!("ready"))?;
        let report = run_role(role.role(), &bus, &asked)?;
        output::print_json(&report)?;
        return Ok(ExitCode::SUCCESS);
    }
    let stack = soak::Stack::start(path, soak::Scheduling::Usual)?;
    let begun = tactnet_channel::now_ns();
    let time = std::time::Instant::now();
    while !stop.asked()
        && arguments
            .seconds
            .is_none_or(|s| time.elapsed().as_secs_f64() < s)
    {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let reports = stack.end()?;
    let seen = soak::Loop::of(&reports, &[(begun, u64::MAX)])?;
    if arguments.json {
        output::print_json(&seen)?;
    } else {
        output::print(format_args!(
            "1 kHz loop: {:.0} us, 99 % below {:.0}, 99.9 % below {:.0}; {} packets lost",
            seen.p50_us,
            seen.p99_us,
            seen.p999_us,
            reports.iter().map(|report| report.lost).sum::<u64>()
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
