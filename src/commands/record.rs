//! `tactnet record`: records the packets of a robot's channels to an MCAP file.

mod in_memory;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use clap::Args;
use serde::Serialize;
use tactnet_channel::{Bus, Domain};
use tactnet_recording::{About, Counts, Recorder, add_packet_types, files_of_run, select_channels};

use super::channel::packets::OwnPacketsArgs;
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
    tactnet record --table robot.toml --out whole.mcap --run runs/a                includes the classifier, for replay anywhere\n  \
    tactnet record --table robot.toml --out skin.mcap --channel 'skin/*'           only these channels\n  \
    tactnet record --table robot.toml --out miss.mcap --before 10 --after 2 --trigger catch/missed   the 10 s before the first packet on this channel, and 2 s after it\n\n\
    With `--before` nothing is written until a packet on the trigger channel, SIGUSR1 or Ctrl-C; then the command writes one file and ends. \
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
    /// Record only these channels; `*` stands for any characters [default: all]
    #[arg(long, value_name = "PATTERN")]
    channel: Vec<String>,
    #[command(flatten)]
    own: OwnPacketsArgs,
    /// Duration, in s [default: until Ctrl-C]
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    #[command(flatten)]
    in_memory: in_memory::InMemoryArgs,
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
    /// Channels whose memory was shorter than `--before`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    short: Vec<String>,
}

impl RecordReport {
    fn new(counts: &Counts, duration: Duration, bytes: u64, short: Vec<String>) -> Self {
        Self {
            schema_version: 1,
            seconds: duration.as_secs_f64(),
            channels: counts.channels,
            messages: counts.messages,
            frames: counts.frames,
            beliefs: counts.beliefs,
            lost: counts.lost,
            bytes,
            short,
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
            Some(run) => files_of_run(network_run(run, NetworkUse::Serve)?.path())?,
        },
    };
    if let Some(description) = arguments.own.description()? {
        add_packet_types(&description);
    }
    let limits = arguments.in_memory.limits()?;
    let table = table::load(&arguments.table)?;
    let bus = Bus::open(Domain::Host, &table)?;
    let table = select_channels(&table, &arguments.channel)?;
    let begun = Instant::now();
    let (recorded, short) = match limits {
        Some(limits) => in_memory::record(arguments, &bus, &table, about, limits, &stop)?,
        None => {
            let mut recorder = Recorder::start(&bus, &table, &arguments.out, &about)?;
            say!("recording to {}; Ctrl-C ends", arguments.out.display());
            output::print(format_args!("ready"))?;
            follow(&mut recorder, seconds, &stop)?;
            (recorder.finish()?, Vec::new())
        }
    };
    let bytes = std::fs::metadata(&arguments.out)?.len();
    let report = RecordReport::new(&recorded, begun.elapsed(), bytes, short);
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

/// Records until Ctrl-C or the end of the duration.
fn follow(recorder: &mut Recorder, seconds: f64, stop: &Stop) -> anyhow::Result<()> {
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
    Ok(())
}
