//! `tactnet record`: what travels on a robot's channels, into an MCAP file.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use clap::Args;
use serde::Serialize;
use tactnet_channel::{Bus, Domain};
use tactnet_recording::{About, Counts, Recorder, files_of_run};

use crate::stop::Stop;
use crate::table;
use crate::{GIT, output};

/// How often it says how far it is.
const TOLD_EVERY: Duration = Duration::from_secs(10);

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet record --table robot.toml --out today.mcap                             until Ctrl-C\n  \
    tactnet record --table robot.toml --out felt.mcap --material felt --seconds 60\n  \
    tactnet record --table robot.toml --out whole.mcap --run runs/a                can be replayed anywhere\n\n\
    Foxglove and the `mcap` tools open the file. If the recorder is killed, all but the last second is there (and what waits for a slow disk). \
    Replaying an hour of one finger at 750 Hz takes about 0.5 GB of memory.")]
pub struct RecordArgs {
    /// The table of channels; `tactnet serve --print-table` prints one, `tactnet catch role --print-table` that of the catching stack
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Where to write; must not be there yet
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
    /// What is swept over, where start commands do not name it
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Keep the classifier that serves in the recording
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// End after so many seconds [default: go on]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Print one JSON document at the end
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct RecordReport {
    schema_version: u32,
    seconds: f64,
    channels: usize,
    messages: u64,
    frames: u64,
    beliefs: u64,
    lost: u64,
    bytes: u64,
}

/// The packets, for people.
fn what(counts: &Counts) -> String {
    if counts.frames + counts.beliefs > 0 {
        format!("{} frames, {} beliefs", counts.frames, counts.beliefs)
    } else {
        format!(
            "{} packets on {} channels",
            counts.messages, counts.channels
        )
    }
}

/// Runs the command.
pub fn run(arguments: &RecordArgs) -> anyhow::Result<ExitCode> {
    let stop = Stop::listen_saying("ending the file")?;
    let seconds = match arguments.seconds {
        None => f64::INFINITY,
        Some(seconds) if seconds > 0.0 => seconds,
        Some(seconds) => bail!("--seconds: expected more than 0, found {seconds}"),
    };
    if arguments.out.exists() {
        bail!(
            "{}: exists already; name another file with `--out`",
            arguments.out.display()
        );
    }
    let about = About {
        material: arguments.material.clone(),
        git: GIT.into(),
        files: match &arguments.run {
            None => Vec::new(),
            Some(run) => files_of_run(run)?,
        },
    };
    let table = table::load(&arguments.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let mut recorder = Recorder::start(&bus, &table, &arguments.out, &about)?;
    say!("recording to {}; Ctrl-C ends", arguments.out.display());
    output::print(format_args!("ready"))?;
    let begun = Instant::now();
    let mut told = begun;
    while !stop.asked() && begun.elapsed().as_secs_f64() < seconds {
        recorder.step(Duration::from_millis(50))?;
        if told.elapsed() >= TOLD_EVERY {
            told = Instant::now();
            let so_far = recorder.counts();
            say!(
                "{:.0} s: {}, {} lost",
                begun.elapsed().as_secs_f64(),
                what(&so_far),
                so_far.lost
            );
        }
    }
    let recorded = recorder.finish()?;
    let told = RecordReport {
        schema_version: 1,
        seconds: begun.elapsed().as_secs_f64(),
        channels: recorded.channels,
        messages: recorded.messages,
        frames: recorded.frames,
        beliefs: recorded.beliefs,
        lost: recorded.lost,
        bytes: std::fs::metadata(&arguments.out)?.len(),
    };
    if arguments.json {
        output::print_json(&told)?;
    } else {
        output::print(format_args!(
            "{}: {}, {} lost, {:.1} MB",
            arguments.out.display(),
            what(&recorded),
            told.lost,
            told.bytes as f64 / 1e6
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
