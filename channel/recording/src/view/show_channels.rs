//! Channels as things happen, or a recording, into a viewer or a file.

use std::fmt;
use std::time::{Duration, Instant};

use serde::Serialize;
use tactnet_channel::{Bus, Table};

use super::{LiveView, Play, Scene, Target};
use crate::{Entry, Listener, RecordedPacket, Recording, RecordingError};

/// How often the viewer gets something new.
const EVERY: Duration = Duration::from_millis(50);
/// How long it may take for what is left.
const PATIENCE: Duration = Duration::from_secs(5);

/// Packets that were shown, as `tactnet view --json` prints them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Viewed {
    /// 1.
    pub schema_version: u32,
    /// Frames.
    pub frames: u64,
    /// Beliefs.
    pub beliefs: u64,
    /// Packets that were put and never came here.
    pub lost: u64,
    /// Packets that came and that the viewer was too slow for.
    pub left_out: u64,
    /// How the viewer went before the end, if it did: somebody has seen enough.
    #[serde(skip)]
    pub gone: Option<String>,
}

impl Default for Viewed {
    fn default() -> Self {
        Self {
            schema_version: 1,
            frames: 0,
            beliefs: 0,
            lost: 0,
            left_out: 0,
            gone: None,
        }
    }
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

impl fmt::Display for Viewed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} frames, {} beliefs", self.frames, self.beliefs)?;
        if self.lost > 0 {
            write!(f, ", {} lost", self.lost)?;
        }
        if self.left_out > 0 {
            write!(f, ", {} left out for a slow viewer", self.left_out)?;
        }
        Ok(())
    }
}

/// Shows a recording from its beginning, and waits until the viewer has all of it.
///
/// # Errors
/// No viewer there; a file that is there already.
pub fn show_recording(
    recording: &Recording,
    title: &str,
    target: &Target,
) -> Result<Viewed, RecordingError> {
    let mut scene = Scene::of_channels(target, title, &recording.table, Play::FromBeginning)?;
    let mut viewed = Viewed::default();
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

/// Shows the channels of `table` as things happen, until `stopped` returns true or the viewer has gone.
///
/// - `time`: how long at most
/// - `on_ready`: called when it listens
///
/// # Errors
/// No hub; channels missing in the table; no viewer there; a file that is there already.
pub fn show_channels(
    bus: &Bus,
    table: &Table,
    target: &Target,
    time: Duration,
    on_ready: impl FnOnce(),
    stopped: &dyn Fn() -> bool,
) -> Result<Viewed, RecordingError> {
    // All channels must be there before a viewer starts; what comes until it has started is not shown.
    drop(Listener::open(bus, table)?);
    let mut view = LiveView::start(target, &table.bus, table)?;
    let mut listener = Listener::open(bus, table)?;
    on_ready();
    let ids: Vec<_> = listener
        .channels()
        .iter()
        .map(|(id, _)| id.clone())
        .collect();
    let mut viewed = Viewed::default();
    let mut batch = Vec::new();
    let (begun, mut shown) = (Instant::now(), Instant::now());
    while !stopped() && begun.elapsed() < time {
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
            viewed.gone = gone(view.show(std::mem::take(&mut batch)))?;
            if viewed.gone.is_some() {
                break;
            }
        }
    }
    // A file gets everything.
    let patience = match target {
        Target::File { .. } => None,
        Target::Viewer { .. } | Target::Connect { .. } => Some(PATIENCE),
    };
    let at_the_end = gone(view.finish(batch, patience))?;
    viewed.gone = viewed.gone.or(at_the_end);
    viewed.lost = listener.lost();
    viewed.left_out = view.left_out();
    Ok(viewed)
}

/// Returns the words for a viewer that was closed or does not answer; other errors stay errors.
fn gone(outcome: Result<(), RecordingError>) -> Result<Option<String>, RecordingError> {
    match outcome {
        Ok(()) => Ok(None),
        Err(gone @ RecordingError::ViewerGone(_)) => Ok(Some(gone.to_string())),
        Err(error) => Err(error),
    }
}
