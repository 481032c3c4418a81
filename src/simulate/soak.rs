//! Everything at once: does the classifier keep up, and does the 1 kHz loop notice it?

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::{Args, ValueEnum};
use serde::Serialize;
use serde_json::Value;
use tactnet_channel::{Bus, Domain, Hub, Priority, Start, Table, Wait, now_ns};
use tactnet_data::twin::{self, TwinConfig};
use tactnet_data::{Dataset, LabelSet, Seed};
use tactnet_pipeline::RunDir;
use tactnet_serving::simulate::{
    CatchingReport, CatchingRole, SkinSimulator, Ticker, catching_table,
};
use tactnet_serving::{Realtime, percentile};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{SkinFrame, Stage, SweepCommand, TactileBelief};

use super::{REST, order_of, unseen_by};
use crate::child_process::{ChildProcess, OwnBus};
use crate::stop::Stop;
use crate::{GIT, output, source};

/// Time with the classifier attached, or without, seconds.
const WINDOW: f64 = 10.0;
/// Of the histogram, microseconds.
const BOUNDS_US: [f64; 10] = [
    300.0, 400.0, 500.0, 600.0, 800.0, 1000.0, 1333.0, 2000.0, 4000.0, 8000.0,
];
/// Left out at the beginning of each window: processes start and end there.
const SETTLE: Duration = Duration::from_millis(500);

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet simulate soak --seconds 30 --json                          a small network is trained first\n  \
    tactnet simulate soak --seconds 600 --run runs/twin-fast-fold0-1   ten minutes with a trained network")]
pub struct SoakArgs {
    /// Time with the classifier attached; as long again without it, in turns of ten seconds
    #[arg(long, value_name = "S", default_value_t = 30.0)]
    seconds: f64,
    /// Run directory of a trained network [default: a small one is trained]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Whose sweeps; only those that the network was not trained on
    #[arg(long, value_name = "FILE|twin", default_value = "twin")]
    data: String,
    /// How the 1 kHz loop, the skin and the classifier are scheduled
    #[arg(long, value_enum, default_value_t)]
    scheduling: Wanted,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// What `--scheduling` says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
enum Wanted {
    /// SCHED_FIFO where it is allowed
    #[default]
    Auto,
    /// SCHED_FIFO, the loop above the skin, the skin above the classifier
    Fifo,
    /// As any other process
    Usual,
}

/// The 1 kHz loop over some time.
#[derive(Serialize)]
pub(super) struct Loop {
    pub(super) rounds: usize,
    pub(super) p50_us: f64,
    pub(super) p99_us: f64,
    pub(super) p999_us: f64,
}

impl Loop {
    /// - `windows`: from and to, nanoseconds of the host's monotonic clock
    pub(super) fn of(reports: &[CatchingReport], windows: &[(u64, u64)]) -> anyhow::Result<Self> {
        let controller = reports
            .iter()
            .find(|report| report.role == CatchingRole::Controller)
            .context("the controller said nothing")?;
        let [p50_us, p99_us, p999_us] = controller.round_us(windows, &[0.5, 0.99, 0.999])[..]
        else {
            bail!("three percentiles")
        };
        let inside = |at: u64| windows.iter().any(|(from, to)| (*from..*to).contains(&at));
        Ok(Self {
            rounds: controller
                .trips
                .iter()
                .filter(|trip| inside(trip.at_ns))
                .count(),
            p50_us,
            p99_us,
            p999_us,
        })
    }
}

impl Wanted {
    fn get(self) -> anyhow::Result<Scheduling> {
        if self == Self::Usual {
            return Ok(Scheduling::Usual);
        }
        let tried = std::thread::spawn(|| priority(1).apply()).join();
        match tried.unwrap_or_default().first() {
            None => Ok(Scheduling::Fifo),
            Some(refused) if self == Self::Fifo => bail!("--scheduling fifo: {refused}"),
            Some(refused) => {
                eprintln!("as usual, not under SCHED_FIFO: {refused}");
                Ok(Scheduling::Usual)
            }
        }
    }
}

/// The processes of the catching stack.
pub(super) struct Stack(Vec<ChildProcess>);

/// How processes are scheduled.
#[derive(Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Scheduling {
    /// As any other.
    Usual,
    /// Under SCHED_FIFO: the 1 kHz loop above the skin, the skin above the classifier.
    Fifo,
}

impl Stack {
    /// Starts them one after the other and waits until each is ready.
    pub(super) fn start(table: &Path, scheduling: Scheduling) -> anyhow::Result<Self> {
        let mut stack = Self(Vec::new());
        for role in CatchingRole::ALL {
            let mut arguments = vec!["simulate", "catching", "--role", role.name()];
            let of_the_loop = matches!(role, CatchingRole::Controller | CatchingRole::Drives);
            if scheduling == Scheduling::Fifo && of_the_loop {
                arguments.extend(["--priority", "80"]);
            }
            arguments.push("--table");
            stack
                .0
                .push(ChildProcess::start(role.name(), &arguments, table)?);
        }
        Ok(stack)
    }

    /// Ends them and gathers what they saw.
    pub(super) fn end(self) -> anyhow::Result<Vec<CatchingReport>> {
        let parts = self.0.into_iter().rev();
        parts
            .map(|part| Ok(serde_json::from_str(&part.end()?)?))
            .collect()
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Soaked {
    schema_version: u32,
    git: &'static str,
    seconds: f64,
    scheduling: Scheduling,
    frames_sent: u64,
    frames_lost: u64,
    sweeps: u64,
    rejected: u64,
    /// Whole sweeps whose most probable material was the true one.
    correct: u64,
    judged: u64,
    beliefs: u64,
    /// From a sweep's last frame to its plain belief.
    belief_latency_p50_us: f64,
    belief_latency_p99_us: f64,
    belief_latency_max_us: f64,
    /// From a sweep's last frame to its Monte Carlo belief.
    dropout_latency_p50_us: f64,
    dropout_latency_p99_us: f64,
    dropout_latency_max_us: f64,
    /// Of a sweep that is going on.
    anytime_latency_p50_us: f64,
    anytime_latency_p99_us: f64,
    allocations_per_frame: f64,
    deadline_misses: u64,
    worst_delay_us: f64,
    loop_with: Loop,
    loop_without: Loop,
    /// Packets of the catching stack that were lost, over the whole time.
    stack_lost: u64,
    /// The loop's 99th percentile with the classifier and the dashboard over the one without.
    loop_p99_ratio: f64,
    /// Median over the turns of that turn's ratio, which a burst of other work on the machine moves less.
    loop_p99_ratio_of_turns: f64,
    histogram: Vec<Bucket>,
}

/// Plain beliefs that came within some time of their last frame.
#[derive(Serialize)]
struct Bucket {
    /// Microseconds; `null`: any time.
    below_us: f64,
    beliefs: usize,
}

/// Beliefs that came, with the truth.
#[derive(Default)]
struct Heard {
    latency_us: [Vec<f64>; 3],
    judged: u64,
    correct: u64,
}

/// Runs the command.
pub fn run(arguments: &SoakArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    if !(arguments.seconds > 0.0 && arguments.seconds <= 86_400.0) {
        bail!("--seconds: expected more than 0 and at most a day");
    }
    let scheduling = arguments.scheduling.get()?;
    let folder = tempfile::tempdir()?;
    let run = match &arguments.run {
        Some(run) => run.clone(),
        None => crate::demo::small_network(folder.path())?,
    };
    let dataset = if arguments.data == source::TWIN {
        twin::generate(&TwinConfig {
            sweeps: crate::demo::SWEEPS,
            ..TwinConfig::default()
        })?
    } else {
        source::load(&arguments.data)?
    };
    let known = RunDir::open(&run)?.config()?.classifier.labels;
    let config = ServeConfig::default();
    let table = catching_table(config.table(&format!("soak{}", std::process::id())));
    let path = folder.path().join("robot.toml");
    std::fs::write(&path, toml::to_string(&table)?)?;
    let sweeps = unseen_by(&dataset, &run)?;
    let played = Played::new(&dataset, &sweeps, &known)?;
    let _own = OwnBus(&table);
    let hub = Hub::spawn(&table)?;
    let soaked = soak(arguments, scheduling, &stop, &run, &played, &table, &path);
    drop(hub);
    let soaked = soaked?;
    if arguments.json {
        output::print_json(&soaked)?;
    } else {
        output::print(format_args!(
            "{} frames, {} lost; {} beliefs; after the last frame {:.0} us, 99 % below {:.0} (dropout {:.0}, {:.0}); \
             {} deadlines missed; {} allocations a frame; 1 kHz loop with/without: {:.3}",
            soaked.frames_sent,
            soaked.frames_lost,
            soaked.beliefs,
            soaked.belief_latency_p50_us,
            soaked.belief_latency_p99_us,
            soaked.dropout_latency_p50_us,
            soaked.dropout_latency_p99_us,
            soaked.deadline_misses,
            soaked.allocations_per_frame,
            soaked.loop_p99_ratio
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn soak(
    arguments: &SoakArgs,
    scheduling: Scheduling,
    stop: &Stop,
    run: &Path,
    played: &Played<'_>,
    table: &Table,
    path: &Path,
) -> anyhow::Result<Soaked> {
    let bus = Bus::open(Domain::Host, table)?;
    let stack = Stack::start(path, scheduling)?;
    let over = Arc::new(AtomicBool::new(false));
    let config = ServeConfig::of(table)?;
    let turns = (arguments.seconds / WINDOW).ceil().max(1.0) as usize;
    let window = Duration::from_secs_f64(arguments.seconds / turns as f64);
    let mut with = Vec::new();
    let mut without = Vec::new();
    let mut served = Vec::new();
    let heard = std::thread::scope(|scope| -> anyhow::Result<Heard> {
        let over_now = Ender(&over);
        let skin = scope.spawn(|| skin(&bus, &config, played, &over, scheduling));
        let heard = scope.spawn(|| listen(&bus, &config, played, &over));
        for turn in 0..turns {
            if stop.asked() {
                break;
            }
            eprintln!("turn {} of {turns}", turn + 1);
            without.push(rest(window, stop));
            let run = run.display().to_string();
            let mut serve = vec!["serve", "--json", "--metrics", "off", "--run", &run];
            if scheduling == Scheduling::Fifo {
                serve.extend(["--priority", "60", "--lock-memory"]);
            }
            serve.push("--table");
            let classifier = ChildProcess::start("classifier", &serve, path)?;
            let page = ["dashboard", "--listen", "127.0.0.1:0", "--table"];
            let dashboard = ChildProcess::start("dashboard", &page, path)?;
            with.push(rest(window, stop));
            served.push(serde_json::from_str::<Value>(&classifier.end()?)?);
            dashboard.end()?;
        }
        drop(over_now);
        skin.join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        heard
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    let reports = stack.end()?;
    if with.is_empty() {
        bail!("stopped before anything was measured");
    }
    let sum = |name: &str| -> u64 {
        served
            .iter()
            .filter_map(|served| served[name].as_u64())
            .sum()
    };
    // Between the first and the last frame of every time that it served.
    let sent: u64 = served
        .iter()
        .filter_map(|served| {
            let ends = &served["sequences"][0];
            Some(ends[1].as_u64()? - ends[0].as_u64()? + 1)
        })
        .sum();
    let mut ratios = with
        .iter()
        .zip(&without)
        .map(|(with, without)| {
            Ok(Loop::of(&reports, &[*with])?.p99_us / Loop::of(&reports, &[*without])?.p99_us)
        })
        .collect::<anyhow::Result<Vec<f64>>>()?;
    ratios.sort_by(f64::total_cmp);
    let loop_with = Loop::of(&reports, &with)?;
    let loop_without = Loop::of(&reports, &without)?;
    let Heard {
        mut latency_us,
        judged,
        correct,
    } = heard;
    latency_us
        .iter_mut()
        .for_each(|l| l.sort_by(f64::total_cmp));
    let at =
        |stage: Stage, share| percentile(&latency_us[stage as usize - 1], share).unwrap_or(0.0);
    let plain = &latency_us[Stage::Plain as usize - 1];
    let histogram = BOUNDS_US
        .iter()
        .map(|bound| (*bound, plain.partition_point(|latency| latency <= bound)))
        .chain([(f64::INFINITY, plain.len())])
        .map(|(below_us, beliefs)| Bucket { below_us, beliefs })
        .collect();
    Ok(Soaked {
        schema_version: 1,
        git: GIT,
        seconds: with.iter().map(|(from, to)| (to - from) as f64 / 1e9).sum(),
        scheduling,
        frames_sent: sent,
        frames_lost: sent.saturating_sub(sum("frames")),
        sweeps: sum("sweeps"),
        rejected: sum("rejected"),
        correct,
        judged,
        beliefs: sum("beliefs"),
        belief_latency_p50_us: at(Stage::Plain, 0.5),
        belief_latency_p99_us: at(Stage::Plain, 0.99),
        belief_latency_max_us: at(Stage::Plain, 1.0),
        dropout_latency_p50_us: at(Stage::Dropout, 0.5),
        dropout_latency_p99_us: at(Stage::Dropout, 0.99),
        dropout_latency_max_us: at(Stage::Dropout, 1.0),
        anytime_latency_p50_us: at(Stage::Anytime, 0.5),
        anytime_latency_p99_us: at(Stage::Anytime, 0.99),
        allocations_per_frame: sum("allocations") as f64 / sum("frames").max(1) as f64,
        deadline_misses: sum("deadline_misses"),
        worst_delay_us: served
            .iter()
            .filter_map(|served| served["worst_delay_us"].as_f64())
            .fold(0.0, f64::max),
        loop_p99_ratio: loop_with.p99_us / loop_without.p99_us,
        loop_p99_ratio_of_turns: percentile(&ratios, 0.5).unwrap_or(f64::NAN),
        loop_with,
        loop_without,
        stack_lost: reports.iter().map(|report| report.lost).sum(),
        histogram,
    })
}

/// The sweeps that the skin plays, and what the classifier calls them.
struct Played<'a> {
    dataset: &'a Dataset,
    order: Vec<usize>,
    /// The classifier's label of each of the data set's.
    labels: Vec<usize>,
}

impl<'a> Played<'a> {
    /// Those of materials that are known.
    ///
    /// - `sweeps`: those to choose from
    fn new(dataset: &'a Dataset, sweeps: &[usize], known: &LabelSet) -> anyhow::Result<Self> {
        let known: Vec<&str> = known.names().collect();
        let names: Vec<&str> = dataset.labels().names().collect();
        let labels: Vec<usize> = names
            .iter()
            .map(|name| {
                known
                    .iter()
                    .position(|known| known == name)
                    .unwrap_or(usize::MAX)
            })
            .collect();
        let materials: Vec<String> = names
            .iter()
            .filter(|name| known.contains(name))
            .map(ToString::to_string)
            .collect();
        if materials.is_empty() {
            bail!("{}: no material that the network knows", dataset.name());
        }
        Ok(Self {
            order: order_of(dataset, sweeps, &materials, Seed(1))?,
            dataset,
            labels,
        })
    }

    fn label_of(&self, motion: u64) -> usize {
        let sweep = self.order[(motion - 1) as usize % self.order.len()];
        self.labels[self.dataset.records()[sweep].label]
    }
}

fn priority(priority: u8) -> Realtime {
    Realtime {
        priority: Some(priority),
        ..Realtime::default()
    }
}

/// Says that it is over, also when something went wrong.
struct Ender<'a>(&'a AtomicBool);

impl Drop for Ender<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Lets everything run; gives from when to when it is measured.
fn rest(time: Duration, stop: &Stop) -> (u64, u64) {
    std::thread::sleep(SETTLE);
    let (from, begun) = (now_ns(), Instant::now());
    while begun.elapsed() < time && !stop.asked() {
        std::thread::sleep(Duration::from_millis(10));
    }
    (from, now_ns())
}

fn skin(
    bus: &Bus,
    config: &ServeConfig,
    played: &Played<'_>,
    over: &AtomicBool,
    scheduling: Scheduling,
) -> anyhow::Result<()> {
    let frames = bus.put_port::<SkinFrame>(config.fingers[0].as_str(), Priority::High)?;
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
    if scheduling == Scheduling::Fifo {
        // It has been tried before.
        priority(70).apply();
    }
    let dataset = played.dataset;
    let mut skin = SkinSimulator::new(dataset, played.order.clone(), config.segmenter.skip, REST);
    let mut ticker = Ticker::new(dataset.sample_rate_hz());
    while !over.load(Ordering::Relaxed) {
        ticker.wait();
        let step = skin.step();
        if let Some(command) = step.command {
            commands.put_copy(&[command])?;
        }
        frames.put_copy(&[step.frame])?;
    }
    Ok(())
}

fn listen(
    bus: &Bus,
    config: &ServeConfig,
    played: &Played<'_>,
    over: &AtomicBool,
) -> anyhow::Result<Heard> {
    let beliefs = bus.get_port::<TactileBelief>(config.belief.as_str(), Start::Now)?;
    let patience = Wait::Block {
        timeout: Duration::from_millis(100),
    };
    let mut heard = Heard::default();
    while !over.load(Ordering::Relaxed) {
        let Some(belief) = beliefs.get(patience)? else {
            continue;
        };
        let Some(belief) = belief.first() else {
            continue;
        };
        let Some(latencies) = heard
            .latency_us
            .get_mut((belief.stage as usize).wrapping_sub(1))
        else {
            continue;
        };
        latencies.push(belief.latency_ns as f64 / 1e3);
        if belief.stage == Stage::Dropout as u32 && belief.motion > 0 {
            heard.judged += 1;
            heard.correct += u64::from(belief.label as usize == played.label_of(belief.motion));
        }
    }
    Ok(heard)
}
