//! Live channels or a recording in a viewer or file.

use std::time::{Duration, Instant};

use serde::Serialize;
use tactnet_channel::{Bus, Table};

use super::{LiveView, Play, Scene, Target};
use crate::{Entry, Listener, RecordedPacket, Recording, RecordingError};

/// Interval at which the viewer gets new data.
const EVERY: Duration = Duration::from_millis(50);
/// Timeout for the remaining data at the end.
const PATIENCE: Duration = Duration::from_secs(5);

/// Counts of the packets that were shown.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Viewed {
    /// Version of this document: 1.
    pub schema_version: u32,
    /// Number of frames.
    pub frames: u64,
    /// Number of beliefs.
    pub beliefs: u64,
    /// Packets that were put and never arrived.
    pub lost: u64,
    /// Packets that were left out because the viewer was too slow.
    pub left_out: u64,
    /// Reason why the viewer ended early, if it did.
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

/// Shows a recording from its beginning, and waits until the viewer has received it.
///
/// # Errors
/// No viewer can be reached; the file exists.
pub fn show_recording(
    recording: &Recording,
    title: &str,
    target: &Target,
) -> Result<Viewed, RecordingError> {
    let mut scene = Scene::of_channels(target, title, &recording.table, Play::FromBeginning)?;
    let mut viewed = Viewed::default();
    // Names of materials come first, at whatever time they were recorded.
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

/// Shows the channels of `table` live, until `stopped` returns true or the viewer has gone.
///
/// - `time`: maximum duration
/// - `on_ready`: called when the channels are open
///
/// # Errors
/// No hub runs; the table lacks a channel; no viewer can be reached; the file exists.
pub fn show_channels(
    bus: &Bus,
    table: &Table,
    target: &Target,
    time: Duration,
    on_ready: impl FnOnce(),
    stopped: &dyn Fn() -> bool,
) -> Result<Viewed, RecordingError> {
    // Checks the channels before a viewer starts. Packets until it has started are not shown.
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
        listener.follow(|received| {
            viewed.count(&received.packet);
            batch.push(Entry {
                channel: ids[received.channel].clone(),
                time_ns: received.put_ns,
                sender: None,
                packet: received.packet,
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
    // A file gets all data, without a timeout.
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

/// Returns the message of a viewer that was closed or does not reply. Other errors stay errors.
fn gone(outcome: Result<(), RecordingError>) -> Result<Option<String>, RecordingError> {
    match outcome {
        Ok(()) => Ok(None),
        Err(gone @ RecordingError::ViewerGone(_)) => Ok(Some(gone.to_string())),
        Err(error) => Err(error),
    }
}
