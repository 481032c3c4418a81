//! `tactnet replay`: replays a recording on channels and compares the classifier's predictions with the recorded ones.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_channel::{Bus, Domain};
use tactnet_pipeline::{RunDir, weights_sha256};
use tactnet_recording::{FrameLosses, Recording, ReplayReport, play, unpack_run};
use tactnet_simulation::replay_alone;

use crate::output::counted;
use crate::stop::Stop;
use crate::table;
use crate::{GIT, failure, output};

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet replay today.mcap --run runs/a             on a private bus, with this classifier\n  \
    tactnet replay whole.mcap --json                   with the classifier included by `record --run`\n  \
    tactnet replay today.mcap --table robot.toml       on the robot's channels\n  \
    tactnet replay today.mcap --run runs/a --speed 4   four times as fast")]
pub struct ReplayArgs {
    /// Recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Channel table of the bus on which to replay, for the classifier that serves there
    #[arg(long, value_name = "FILE", conflicts_with = "run")]
    table: Option<PathBuf>,
    /// Run directory to serve on a private bus [default: the classifier of the recording]
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Speed relative to the recording; frames are lost if it is too fast for the classifier
    #[arg(long, value_name = "N", default_value_t = 1.0)]
    speed: f64,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Returns the hash of a run's weights.
fn weights_of(run: &Path) -> anyhow::Result<String> {
    Ok(weights_sha256(
        &RunDir::open(run)?.network("be served")?.weights()?,
    )?)
}

/// Replays the recording.
pub fn run(arguments: &ReplayArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("stopping")?;
    if !(arguments.speed.is_finite() && arguments.speed > 0.0) {
        bail!("--speed: expected more than 0, found {}", arguments.speed);
    }
    let recording = Recording::read(&arguments.file)?;
    if let Some(cut) = &recording.cut {
        say!(
            "{}: the end is missing ({cut}); it contains {} messages",
            arguments.file.display(),
            recording.entries.len()
        );
    }
    let folder = tempfile::tempdir()?;
    let (speed, stopped) = (arguments.speed, || stop.asked());
    let mut another_asked = false;
    let (played, frames_lost) = match &arguments.table {
        Some(path) => {
            let table = table::load(path)?;
            let bus = Bus::open(Domain::Host, &table)?;
            let losses = FrameLosses::open(&bus, &table)?;
            let played = play(&recording, &bus, &table, speed, &stopped)?;
            (played, losses.since()?)
        }
        None => {
            let kept = unpack_run(&recording, folder.path())?;
            if let (Some(asked), Some(kept)) = (&arguments.run, &kept) {
                another_asked = weights_of(asked)? != weights_of(kept)?;
            }
            let Some(run) = arguments.run.clone().or(kept) else {
                bail!(
                    "{}: no classifier: name a run directory with `--run`, or the channels of a running classifier with `--table`; `tactnet record --run` includes it in the recording",
                    arguments.file.display()
                );
            };
            let program = std::env::current_exe()?;
            replay_alone(&program, &run, folder.path(), &recording, speed, &stopped)?
        }
    };
    let report = ReplayReport::new(GIT, &recording, played, frames_lost, speed, another_asked)?;
    if stop.asked() {
        say!("stopped before the end");
    }
    print_notes(&recording, &report);
    if arguments.json {
        output::print_json(&report)?;
    } else {
        output::print(summary(&report))?;
    }
    Ok(if stop.asked() {
        ExitCode::from(failure::INTERRUPTED)
    } else {
        ExitCode::SUCCESS
    })
}

/// Returns the result in one line.
fn summary(report: &ReplayReport) -> String {
    let comparison = match report.identical {
        None => "the recording contains none to compare".into(),
        Some(true) => "identical to the recorded ones".into(),
        Some(false) => format!(
            "{} of {} recorded ones differ{}",
            report.differing,
            report.recorded.beliefs,
            if report.another_asked {
                ": another network, as requested"
            } else {
                " (another network, or another version?)"
            }
        ),
    };
    let not_compared = match report.recorded.unfinished {
        0 => String::new(),
        more => format!(
            "; {more} more recorded ones are not compared since the beginning or end of their sweep is missing"
        ),
    };
    format!(
        "{} frames, {} lost; {} sweeps, {} beliefs, {comparison}{not_compared}",
        report.frames, report.frames_lost, report.replayed.sweeps, report.replayed.beliefs
    )
}

/// Prints notes about shortened pauses and skipped messages.
fn print_notes(recording: &Recording, report: &ReplayReport) {
    if report.pauses_cut > 0 {
        say!(
            "{} of over a minute shortened to one minute: a damaged timestamp, or an idle robot",
            counted(report.pauses_cut, "pause")
        );
    }
    if recording.foreign > 0 {
        say!("skipped: {} messages of other types", recording.foreign);
    }
}
