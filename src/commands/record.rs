//! `tactnet record`: records the packets of a robot's channels to an MCAP file.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use clap::Args;
use serde::Serialize;
use tactnet_channel::{Bus, Domain};
use tactnet_recording::{About, Counts, Recorder, files_of_run};

use super::network_run::{NetworkUse, network_run};
use crate::stop::Stop;
use crate::table;
use crate::{GIT, output};

/// Interval between two progress lines.
const REPORT_INTERVAL: Duration = Duration::from_secs(10);

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet record --table robot.toml --out today.mcap                             until Ctrl-C\n  \
    tactnet record --table robot.toml --out felt.mcap --material felt --seconds 60\n  \
    tactnet record --table robot.toml --out whole.mcap --run runs/a                includes the classifier, for replay anywhere\n\n\
    Foxglove and the `mcap` tools open the file. If the recorder is killed, at most the last second is lost, plus data waiting for a slow disk. \
    Replaying an hour of one finger at 750 Hz needs about 0.5 GB of memory.")]
pub struct RecordArgs {
    /// Channel table; `tactnet serve --print-table` prints one, `tactnet catch role --print-table` that of the catching stack
    #[arg(long, value_name = "FILE")]
    table: PathBuf,
    /// Output file; must not exist
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
    /// Material under the finger, for start commands that do not name it
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Run directory of the serving classifier, to include in the recording
    #[arg(long, value_name = "DIR")]
    run: Option<PathBuf>,
    /// Duration, in s [default: until Ctrl-C]
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

impl RecordReport {
    fn new(counts: &Counts, duration: Duration, bytes: u64) -> Self {
        Self {
            schema_version: 1,
            seconds: duration.as_secs_f64(),
            channels: counts.channels,
            messages: counts.messages,
            frames: counts.frames,
            beliefs: counts.beliefs,
            lost: counts.lost,
            bytes,
        }
    }
}

/// Describes the recorded packets.
fn describe(counts: &Counts) -> String {
    if counts.frames + counts.beliefs > 0 {
        format!("{} frames, {} beliefs", counts.frames, counts.beliefs)
    } else {
        format!(
            "{} packets on {} channels",
            counts.messages, counts.channels
        )
    }
}

/// Records until Ctrl-C or the end of the duration.
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
            Some(run) => files_of_run(network_run(run, NetworkUse::Serve)?.path())?,
        },
    };
    let table = table::load(&arguments.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let mut recorder = Recorder::start(&bus, &table, &arguments.out, &about)?;
    say!("recording to {}; Ctrl-C ends", arguments.out.display());
    output::print(format_args!("ready"))?;
    let begun = Instant::now();
    let mut reported = begun;
    while !stop.asked() && begun.elapsed().as_secs_f64() < seconds {
        recorder.step(Duration::from_millis(50))?;
        if reported.elapsed() >= REPORT_INTERVAL {
            reported = Instant::now();
            let so_far = recorder.counts();
            say!(
                "{:.0} s: {}, {} lost",
                begun.elapsed().as_secs_f64(),
                describe(&so_far),
                so_far.lost
            );
        }
    }
    let recorded = recorder.finish()?;
    let bytes = std::fs::metadata(&arguments.out)?.len();
    let report = RecordReport::new(&recorded, begun.elapsed(), bytes);
    if arguments.json {
        output::print_json(&report)?;
    } else {
        output::print(format_args!(
            "{}: {}, {} lost, {:.1} MB",
            arguments.out.display(),
            describe(&recorded),
            report.lost,
            report.bytes as f64 / 1e6
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
