//! `tactnet replay`: a recording back onto channels, and whether the classifier says the same again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::Args;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest, Sha256};
use tactnet_channel::{Bus, Domain, Hub, Network, Priority, PutPort, Start, Table, Wait};
use tactnet_recording::{Entry, RecordedPacket, Recording};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{
    Command, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus,
};

use crate::child_process::{ChildProcess, OwnBus};
use crate::record::RUN;
use crate::stop::Stop;
use crate::{GIT, output};

/// No belief comes so long after its last frame.
const SILENCE: Duration = Duration::from_millis(500);

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet replay today.mcap --run runs/a             on channels of its own, with this classifier\n  \
    tactnet replay whole.mcap --json                   with the classifier that was recorded with `record --run`\n  \
    tactnet replay today.mcap --table robot.toml       on the robot's channels, for whoever listens there\n  \
    tactnet replay today.mcap --run runs/a --speed 4   four times as fast")]
pub struct ReplayArgs {
    /// A recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Put it on these channels, for the classifier that serves there
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    table: Option<PathBuf>,
    /// Serve this run directory on channels of its own [default: the classifier of the recording]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// How much faster than it happened; too fast for the classifier, frames are lost
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    speed: f64,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Beliefs about sweeps that were judged as a whole.
#[derive(Debug, Serialize)]
struct Beliefs {
    /// Such sweeps.
    sweeps: usize,
    /// Beliefs about them, anytime beliefs included.
    beliefs: usize,
    /// Of finger, stage, frames, last frame and posterior of each, in order.
    posterior_sha256: String,
    #[serde(skip)]
    about: Vec<TactileBelief>,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Replayed {
    schema_version: u32,
    git: &'static str,
    seconds: f64,
    speed: f64,
    frames: usize,
    frames_lost: u64,
    commands: usize,
    #[serde(flatten)]
    replayed: Beliefs,
    recorded: Beliefs,
    /// Whether every recorded belief came again, bit by bit, with label, verdict and strangeness; `null`: there was none to compare.
    identical: Option<bool>,
    /// Why the recording's end is missing, if it is.
    cut: Option<String>,
}

/// Runs the command.
pub fn run(arguments: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    if !(arguments.speed.is_finite() && arguments.speed > 0.0) {
        bail!("--speed: expected more than 0, found {}", arguments.speed);
    }
    let recording = Recording::read(&arguments.file)?;
    if let Some(cut) = &recording.cut {
        eprintln!(
            "{}: the end is missing ({cut}); {} messages are there",
            arguments.file.display(),
            recording.entries.len()
        );
    }
    let folder = tempfile::tempdir()?;
    let replayed = match &arguments.table {
        Some(path) => {
            let table = Table::load(path)?;
            let bus = Bus::open(Domain::Host, &table)?;
            let lost = Losses::of(&bus, &table)?;
            let played = play(&recording, &bus, &table, arguments.speed, &stop)?;
            let frames_lost = lost.since()?;
            Replayed::new(&recording, played, frames_lost, arguments.speed)?
        }
        None => {
            let run = match &arguments.run {
                Some(run) => run.clone(),
                None => unpack(&recording, &arguments.file, folder.path())?,
            };
            alone(&recording, &run, folder.path(), arguments.speed, &stop)?
        }
    };
    if stop.asked() {
        eprintln!("stopped before the end");
    }
    if recording.foreign > 0 {
        eprintln!(
            "left out: {} messages that are none of ours",
            recording.foreign
        );
    }
    if arguments.json {
        output::print_json(&replayed)?;
    } else {
        let alike = match replayed.identical {
            None => "the recording has none to compare",
            Some(true) => "bit by bit as recorded",
            Some(false) => "not what was recorded (another classifier?)",
        };
        output::print(format_args!(
            "{} frames, {} lost; {} sweeps, {} beliefs, {alike}",
            replayed.frames,
            replayed.frames_lost,
            replayed.replayed.sweeps,
            replayed.replayed.beliefs
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What was put, and what was believed.
struct Played {
    seconds: f64,
    frames: usize,
    commands: usize,
    /// By finger.
    last_frames: BTreeMap<u32, u64>,
    beliefs: Vec<TactileBelief>,
}

impl Replayed {
    fn new(
        recording: &Recording,
        played: Played,
        frames_lost: u64,
        speed: f64,
    ) -> anyhow::Result<Self> {
        let mut recorded = recorded_beliefs(recording)?;
        let replayed = Beliefs::of(&played.beliefs);
        // What was not played cannot come again.
        recorded.about.retain(|belief| {
            played
                .last_frames
                .get(&belief.finger)
                .is_some_and(|last| belief.last_frame <= *last)
        });
        Ok(Self {
            schema_version: 1,
            git: GIT,
            seconds: played.seconds,
            speed,
            frames: played.frames,
            frames_lost,
            commands: played.commands,
            identical: (!recorded.about.is_empty()).then(|| recorded.came_again_in(&replayed)),
            replayed,
            recorded,
            cut: recording.cut.clone(),
        })
    }
}

impl Beliefs {
    /// - `beliefs`: in the order in which they came
    fn of(beliefs: &[TactileBelief]) -> Self {
        let last = if beliefs.iter().any(|b| b.stage == Stage::Dropout as u32) {
            Stage::Dropout
        } else {
            Stage::Plain
        };
        // By finger: the beliefs about the sweep that is going on.
        let mut open: BTreeMap<u32, Vec<TactileBelief>> = BTreeMap::new();
        let mut whole: BTreeMap<u32, Vec<Vec<TactileBelief>>> = BTreeMap::new();
        for belief in beliefs {
            let sweep = open.entry(belief.finger).or_default();
            // Another one has begun, perhaps of a service that was started anew.
            if sweep
                .last()
                .is_some_and(|before| before.sweep != belief.sweep)
            {
                sweep.clear();
            }
            sweep.push(*belief);
            if belief.stage == last as u32 {
                let ended = std::mem::take(sweep);
                whole.entry(belief.finger).or_default().push(ended);
            }
        }
        let sweeps = whole.values().map(Vec::len).sum();
        let about: Vec<TactileBelief> = whole.into_values().flatten().flatten().collect();
        let mut hash = Sha256::new();
        for belief in &about {
            for number in [belief.finger, belief.stage, belief.frames] {
                hash.update(number.to_le_bytes());
            }
            hash.update(belief.last_frame.to_le_bytes());
            for p in posterior(belief) {
                hash.update(p.to_le_bytes());
            }
        }
        Self {
            sweeps,
            beliefs: about.len(),
            posterior_sha256: hash
                .finalize()
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect(),
            about,
        }
    }

    /// Whether each of these is among `others`, bit by bit.
    fn came_again_in(&self, others: &Self) -> bool {
        let key = |b: &TactileBelief| (b.finger, b.last_frame, b.stage);
        let others: BTreeMap<_, _> = others.about.iter().map(|b| (key(b), b)).collect();
        self.about.iter().all(|belief| {
            others.get(&key(belief)).is_some_and(|other| {
                let numbers = |b: &TactileBelief| (b.frames, b.filled_in, b.label, b.verdict);
                let floats =
                    |b: &TactileBelief| [b.entropy, b.strangeness, b.threshold].map(f32::to_bits);
                let bits = |b: &TactileBelief| -> Vec<u32> {
                    posterior(b).iter().map(|p| p.to_bits()).collect()
                };
                numbers(belief) == numbers(other)
                    && floats(belief) == floats(other)
                    && bits(belief) == bits(other)
            })
        })
    }
}

fn posterior(belief: &TactileBelief) -> &[f32] {
    &belief.posterior[..(belief.materials as usize).min(belief.posterior.len())]
}

/// Those about sweeps whose beginning was recorded, too.
fn recorded_beliefs(recording: &Recording) -> anyhow::Result<Beliefs> {
    let config = ServeConfig::of(&recording.table)?;
    let by_command = config.segmenter.segmentation == tactnet_skin::Segmentation::Command;
    let mut begun: Vec<(u32, u64)> = Vec::new();
    let mut beliefs = Vec::new();
    for entry in &recording.entries {
        match &entry.packet {
            RecordedPacket::Command(command) if command.command() == Some(Command::Start) => {
                begun.push((command.finger, command.motion));
            }
            RecordedPacket::Belief(belief)
                if !by_command || begun.contains(&(belief.finger, belief.motion)) =>
            {
                beliefs.push(**belief);
            }
            _ => {}
        }
    }
    Ok(Beliefs::of(&beliefs))
}

/// The classifier of a recording, as a run directory.
fn unpack(recording: &Recording, file: &Path, folder: &Path) -> anyhow::Result<PathBuf> {
    let run = folder.join("run");
    std::fs::create_dir(&run)?;
    let mut any = false;
    for (name, bytes) in &recording.files {
        // Names with a path in them are not ours.
        if let Some(name) = name.strip_prefix(RUN)
            && Path::new(name).components().count() == 1
            && Path::new(name).file_name().is_some()
        {
            std::fs::write(run.join(name), bytes)?;
            any = true;
        }
    }
    if !any {
        bail!(
            "{}: which classifier: name a run with `--run`, or channels where one serves with `--table`; `tactnet record --run` keeps it in the recording",
            file.display()
        );
    }
    Ok(run)
}

/// On channels of its own.
fn alone(
    recording: &Recording,
    run: &Path,
    folder: &Path,
    speed: f64,
    stop: &Stop,
) -> anyhow::Result<Replayed> {
    let mut table = Table {
        bus: format!("replay{}", std::process::id()),
        network: Network::default(),
        ..recording.table.clone()
    };
    // It is nobody else's business.
    for channel in table.channels.values_mut() {
        channel.distributed = false;
    }
    let path = folder.join("robot.toml");
    std::fs::write(&path, toml::to_string(&table)?)?;
    let _own = OwnBus(&table);
    let hub = Hub::spawn(&table)?;
    let run = run.display().to_string();
    let serve = [
        "serve",
        "--json",
        "--metrics",
        "off",
        "--run",
        &run,
        "--table",
    ];
    let classifier = ChildProcess::start("classifier", &serve, &path)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let played = play(recording, &bus, &table, speed, stop);
    let served: Value = serde_json::from_str(&classifier.end()?)?;
    drop(hub);
    let frames_lost = served["dropped_frames"].as_u64().unwrap_or(0);
    Replayed::new(recording, played?, frames_lost, speed)
}

/// Puts frames and commands at their times, and listens.
fn play(
    recording: &Recording,
    bus: &Bus,
    table: &Table,
    speed: f64,
    stop: &Stop,
) -> anyhow::Result<Played> {
    let config = ServeConfig::of(table)?;
    let beliefs = bus.get_port::<TactileBelief>(config.belief.as_str(), Start::Now)?;
    let commands = bus.put_port::<SweepCommand>(config.command.as_str(), Priority::High)?;
    let mut skins: BTreeMap<&str, (u32, PutPort<SkinFrame>)> = BTreeMap::new();
    for (number, finger) in (0..).zip(&config.fingers) {
        let port = bus.put_port(finger.as_str(), Priority::High)?;
        skins.insert(finger, (number, port));
    }
    let mut last_frames = BTreeMap::new();
    let over = &AtomicBool::new(false);
    let (mut frames, mut put_commands) = (0, 0);
    let begun = Instant::now();
    let heard = std::thread::scope(|scope| -> anyhow::Result<Vec<TactileBelief>> {
        let over_now = Over(over);
        let listener = scope.spawn(move || -> anyhow::Result<Vec<TactileBelief>> {
            let mut heard = Vec::new();
            let mut newest = Instant::now();
            while !over.load(Ordering::Relaxed) || newest.elapsed() < SILENCE {
                let patience = Wait::Block {
                    timeout: Duration::from_millis(20),
                };
                if let Some(belief) = beliefs.get(patience)? {
                    heard.extend(belief.first());
                    newest = Instant::now();
                } else if !over.load(Ordering::Relaxed) {
                    newest = Instant::now();
                }
            }
            Ok(heard)
        });
        let moves = |entry: &&Entry| {
            matches!(
                entry.packet,
                RecordedPacket::Frame(_) | RecordedPacket::Command(_)
            )
        };
        let entries = || recording.entries.iter().filter(moves);
        let first_ns = entries().next().map_or(0, |entry| entry.time_ns);
        for entry in entries() {
            let due = (entry.time_ns - first_ns) as f64 / 1e9 / speed;
            if !wait_until(begun, due, stop) {
                break;
            }
            match &entry.packet {
                RecordedPacket::Frame(frame) => {
                    let Some((number, skin)) = skins.get(&*entry.channel) else {
                        bail!("no channel `{}` in this table", entry.channel);
                    };
                    skin.put_copy(&[*frame])?;
                    last_frames.insert(*number, frame.sequence);
                    frames += 1;
                }
                RecordedPacket::Command(command) => {
                    commands.put_copy(&[*command])?;
                    put_commands += 1;
                }
                _ => {}
            }
        }
        drop(over_now);
        listener
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })?;
    Ok(Played {
        seconds: begun.elapsed().as_secs_f64(),
        frames,
        commands: put_commands,
        last_frames,
        beliefs: heard,
    })
}

/// Waits until `due` seconds after `begun`; false when somebody asked to stop.
fn wait_until(begun: Instant, due: f64, stop: &Stop) -> bool {
    loop {
        if stop.asked() {
            return false;
        }
        let left = due - begun.elapsed().as_secs_f64();
        if left <= 0.0 {
            return true;
        }
        std::thread::sleep(Duration::from_secs_f64(left.min(0.05)));
    }
}

/// Says that it is over, however it ends.
struct Over<'a>(&'a AtomicBool);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Frames that a classifier somewhere has lost since.
struct Losses {
    status: tactnet_channel::GetPort<TactileStatus>,
    before: u64,
}

impl Losses {
    fn of(bus: &Bus, table: &Table) -> anyhow::Result<Self> {
        let config = ServeConfig::of(table)?;
        let status = bus.get_port(config.status.as_str(), Start::Now)?;
        let mut losses = Self { status, before: 0 };
        losses.before = losses
            .now()?
            .context("no classifier serves on these channels")?;
        Ok(losses)
    }

    /// The newest count.
    fn now(&self) -> anyhow::Result<Option<u64>> {
        while self.status.try_get()?.is_some() {}
        let patience = Wait::Block {
            timeout: Duration::from_secs(2),
        };
        let status = self.status.get(patience)?;
        Ok(status.and_then(|status| Some(status.first()?.counters.dropped_frames)))
    }

    fn since(&self) -> anyhow::Result<u64> {
        let now = self.now()?.context("the classifier has ended")?;
        Ok(now.saturating_sub(self.before))
    }
}
