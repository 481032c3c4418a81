//! `tactnet replay`: a recording back onto channels, and whether the classifier says the same again.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_channel::{Bus, Domain, Hub, Network, Table};
use tactnet_recording::{FrameLosses, Recording, ReplayReport, play, unpack_run};
use tactnet_rehearsal::{ChildProcess, OwnBus};
use tactnet_serving::ServeReport;

use crate::stop::Stop;
use crate::{GIT, output};

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
            let losses = FrameLosses::open(&bus, &table)?;
            let played = play(&recording, &bus, &table, arguments.speed, &|| stop.asked())?;
            let frames_lost = losses.since()?;
            ReplayReport::new(GIT, &recording, played, frames_lost, arguments.speed)?
        }
        None => {
            let run = match &arguments.run {
                Some(run) => run.clone(),
                None => match unpack_run(&recording, folder.path())? {
                    Some(run) => run,
                    None => bail!(
                        "{}: which classifier: name a run with `--run`, or channels where one serves with `--table`; `tactnet record --run` keeps it in the recording",
                        arguments.file.display()
                    ),
                },
            };
            on_own_channels(&recording, &run, folder.path(), arguments.speed, &stop)?
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
        output::print(replayed)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Replays on channels that nobody else uses, with a classifier beside this process.
fn on_own_channels(
    recording: &Recording,
    run: &Path,
    folder: &Path,
    speed: f64,
    stop: &Stop,
) -> anyhow::Result<ReplayReport> {
    let mut table = Table {
        bus: format!("replay{}", std::process::id()),
        network: Network::default(),
        ..recording.table.clone()
    };
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
    let program = std::env::current_exe()?;
    let classifier = ChildProcess::start(&program, "classifier", &serve, &path)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let played = play(recording, &bus, &table, speed, &|| stop.asked());
    let served: ServeReport = classifier.end_with_report()?;
    drop(hub);
    Ok(ReplayReport::new(
        GIT,
        recording,
        played?,
        served.dropped_frames,
        speed,
    )?)
}
