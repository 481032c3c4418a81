//! `tactnet view`: channels as things happen, or a recording.

use std::path::Path;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::bail;
use serde::Serialize;
use tactnet_channel::{Bus, Domain, Table};
use tactnet_recording::view::{LiveView, Play, Scene, Target};
use tactnet_recording::{Entry, Listener, RecordedPacket, Recording, RecordingError};

use super::ViewArgs;
use super::arguments::TargetArgs;
use crate::output;
use crate::stop::Stop;

/// How often the viewer gets something new.
const EVERY: Duration = Duration::from_millis(50);
/// How long it may take for what is left.
const PATIENCE: Duration = Duration::from_secs(5);

/// What `--json` prints.
#[derive(Default, Serialize)]
struct Viewed {
    schema_version: u32,
    frames: u64,
    beliefs: u64,
    /// Packets that were put and never came here.
    lost: u64,
    /// Packets that came and that the viewer was too slow for.
    left_out: u64,
}

impl TargetArgs {
    /// Where the pictures go.
    pub(super) fn target(&self) -> Target {
        match (&self.save, &self.connect) {
            (Some(path), _) => Target::File { path: path.clone() },
            (None, Some(url)) => Target::Connect { url: url.clone() },
            (None, None) => Target::Viewer {
                memory_limit: self.memory_limit.clone(),
            },
        }
    }

    /// Says where they went.
    pub(super) fn told(&self, what: &str) -> String {
        match &self.save {
            Some(path) => format!("{}: {what}; `rerun {0}` shows it", path.display()),
            None => what.into(),
        }
    }
}

/// Runs the command.
pub fn run(arguments: &ViewArgs) -> anyhow::Result<ExitCode> {
    let seconds = arguments.seconds.unwrap_or(f64::INFINITY);
    if seconds.is_nan() || seconds <= 0.0 {
        bail!("--seconds: expected more than 0, found {seconds}");
    }
    let target = arguments.target.target();
    let viewed = match (&arguments.file, &arguments.table) {
        (Some(file), _) => show_recording(file, &target)?,
        (None, Some(table)) => show_channels(table, &target, seconds)?,
        (None, None) => bail!("expected a recording, or `--table` to look on live"),
    };
    if arguments.target.json {
        output::print_json(&viewed)?;
    } else {
        let mut what = format!("{} frames, {} beliefs", viewed.frames, viewed.beliefs);
        for (number, why) in [
            (viewed.lost, "lost"),
            (viewed.left_out, "left out for a slow viewer"),
        ] {
            if number > 0 {
                what += &format!(", {number} {why}");
            }
        }
        output::print(arguments.target.told(&what))?;
    }
    Ok(ExitCode::SUCCESS)
}

impl Viewed {
    fn count(&mut self, packet: &RecordedPacket) {
        match packet {
            RecordedPacket::Frame(_) => self.frames += 1,
            RecordedPacket::Belief(_) => self.beliefs += 1,
            _ => {}
        }
    }
}

fn show_recording(file: &Path, target: &Target) -> anyhow::Result<Viewed> {
    let recording = Recording::read(file)?;
    if let Some(cut) = &recording.cut {
        eprintln!("{}: the end is missing ({cut})", file.display());
    }
    let title = file.display().to_string();
    let mut scene = Scene::of_channels(target, &title, &recording.table, Play::FromBeginning)?;
    let mut viewed = Viewed {
        schema_version: 1,
        ..Viewed::default()
    };
    // The names come first, wherever the service said them.
    let is_model = |entry: &&Entry| matches!(entry.packet, RecordedPacket::Model(_));
    if let Some(model) = recording.entries.iter().find(is_model) {
        scene.show(model)?;
    }
    for entry in &recording.entries {
        viewed.count(&entry.packet);
        scene.show(entry)?;
    }
    scene.finish()?;
    Ok(viewed)
}

fn show_channels(path: &Path, target: &Target, seconds: f64) -> anyhow::Result<Viewed> {
    let stop = Stop::listen_saying("ending")?;
    let table = Table::load(path)?;
    let bus = Bus::open(Domain::Host, &table)?;
    // Whether all channels are there; what comes while the viewer starts is none of its business.
    drop(Listener::open(&bus, &table)?);
    let mut view = LiveView::start(target, &table.bus, &table)?;
    let mut listener = Listener::open(&bus, &table)?;
    eprintln!("looking on; Ctrl-C ends");
    output::print(format_args!("ready"))?;
    let ids: Vec<_> = listener
        .channels()
        .iter()
        .map(|(id, _)| id.clone())
        .collect();
    let mut viewed = Viewed {
        schema_version: 1,
        ..Viewed::default()
    };
    let mut batch = Vec::new();
    let (begun, mut shown) = (Instant::now(), Instant::now());
    while !stop.asked() && begun.elapsed().as_secs_f64() < seconds {
        listener.wait(EVERY)?;
        listener.follow(|heard| {
            viewed.count(&heard.packet);
            batch.push(Entry {
                channel: ids[heard.channel].clone(),
                time_ns: heard.put_ns,
                packet: heard.packet,
            });
        })?;
        if shown.elapsed() >= EVERY {
            shown = Instant::now();
            if closed(view.show(std::mem::take(&mut batch)))? {
                break;
            }
        }
    }
    // A file gets everything.
    let patience = match target {
        Target::File { .. } => None,
        Target::Viewer { .. } | Target::Connect { .. } => Some(PATIENCE),
    };
    closed(view.finish(batch, patience))?;
    viewed.lost = listener.lost();
    viewed.left_out = view.left_out();
    Ok(viewed)
}

/// Whether the viewer was closed or does not answer: somebody has seen enough.
fn closed(outcome: Result<(), RecordingError>) -> Result<bool, RecordingError> {
    match outcome {
        Ok(()) => Ok(false),
        Err(gone @ RecordingError::ViewerGone(_)) => {
            eprintln!("{gone}");
            Ok(true)
        }
        Err(error) => Err(error),
    }
}
