//! Content of one viewer or file: time, fingers and events.

use std::time::Duration;

use re_sdk::log::{ChunkBatcherConfig, TimeColumn};
use re_sdk::sink::SinkFlushError;
use re_sdk::{
    EntityPath, RecordingStream, RecordingStreamBuilder, SerializationError,
    SerializedComponentColumn,
};
use re_sdk_types::archetypes::TextLog;
use tactnet_channel::Table;
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Command, Event, ModelNames, SweepCommand, TactileStatus};

use super::beliefs::BeliefColumns;
use super::skin::SkinColumns;
use super::{Stretch, Target, layout};
use crate::{Entry, RecordedPacket, RecordingError};

/// Maximum number of bytes that the viewer's library may buffer.
const HELD_BACK: u64 = 8 << 20;
/// Timeout of the viewer's first reply.
const FIRST: Duration = Duration::from_secs(30);
/// Interval at which the connection to a slow viewer is checked.
const ASKED_EVERY: Duration = Duration::from_secs(5);

/// Zero of the timeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeOrigin {
    /// The year 1970, for events at a time of day.
    Epoch,
    /// The start of the first sweep.
    Begin,
}

/// Playback of the viewer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Play {
    /// Follows new data.
    Following,
    /// Plays from the first to the last entry.
    FromBeginning,
}

/// Columns of a finger.
struct Finger {
    id: String,
    skin: SkinColumns,
    beliefs: BeliefColumns,
}

/// Content of one viewer or file.
pub struct Scene {
    stream: Stream,
    target: Target,
    fingers: Vec<Finger>,
    materials: Vec<String>,
}

/// Stream to the viewer's library, on one timeline.
pub(super) struct Stream {
    recording: RecordingStream,
    origin: TimeOrigin,
}

impl Stream {
    pub(super) fn new(recording: RecordingStream, origin: TimeOrigin) -> Self {
        Self { recording, origin }
    }

    /// Returns the column of times.
    ///
    /// - `times_ns`: nanoseconds since the origin
    pub(super) fn times(&self, times_ns: Vec<i64>) -> TimeColumn {
        match self.origin {
            TimeOrigin::Epoch => TimeColumn::new_timestamp_nanos_since_epoch("time", times_ns),
            TimeOrigin::Begin => TimeColumn::new_duration_nanos("time", times_ns),
        }
    }

    /// Sends several rows of one entity.
    pub(super) fn send<C: IntoIterator<Item = SerializedComponentColumn>>(
        &self,
        entity: impl Into<EntityPath>,
        indexes: impl IntoIterator<Item = TimeColumn>,
        columns: Result<C, SerializationError>,
    ) -> Result<(), RecordingError> {
        let columns = columns.map_err(|error| RecordingError::Viewer(error.to_string()))?;
        Ok(self.recording.send_columns(entity, indexes, columns)?)
    }

    /// Sends static data of one entity.
    pub(super) fn send_static(
        &self,
        entity: impl Into<EntityPath>,
        what: &impl re_sdk::AsComponents,
    ) -> Result<(), RecordingError> {
        Ok(self.recording.log_static(entity, what)?)
    }

    /// Waits until `target` has received everything, without a timeout.
    pub(super) fn finish(self, target: &Target) -> Result<(), RecordingError> {
        if let Err(error) = self.recording.flush_with_timeout(FIRST) {
            let absent = target.absent(&error.to_string());
            self.abandon();
            return Err(absent);
        }
        Ok(())
    }

    /// Drops the stream without waiting for the viewer.
    fn abandon(self) {
        std::mem::forget(self.recording);
    }
}

impl Scene {
    /// Opens a viewer or file.
    ///
    /// - `title`: title in the viewer
    /// - `fingers`: ids of their channels
    ///
    /// # Errors
    /// No viewer can be reached; the file exists.
    pub fn open(
        target: &Target,
        title: &str,
        fingers: &[&str],
        origin: TimeOrigin,
        play: Play,
    ) -> Result<Self, RecordingError> {
        let mut batching = ChunkBatcherConfig::LOW_LATENCY;
        batching.max_bytes_in_flight = HELD_BACK;
        let builder = RecordingStreamBuilder::new("tactnet")
            .recording_name(title)
            .batcher_config(batching)
            .with_blueprint(layout::blueprint(fingers, origin, play));
        let stream = Stream::new(target.open(builder, play)?, origin);
        for id in fingers {
            BeliefColumns::prepare(&stream, id)?;
        }
        let scene = Self {
            stream,
            target: target.clone(),
            fingers: fingers
                .iter()
                .map(|id| Finger {
                    id: (*id).into(),
                    skin: SkinColumns::default(),
                    beliefs: BeliefColumns::default(),
                })
                .collect(),
            materials: Vec::new(),
        };
        match scene.stream.recording.flush_with_timeout(FIRST) {
            Ok(()) => Ok(scene),
            Err(error) => {
                let absent = target.absent(&error.to_string());
                scene.stream.abandon();
                Err(absent)
            }
        }
    }

    /// Opens a scene of the classifier's channels.
    ///
    /// # Errors
    /// The same as [`Scene::open`]; the table has no section of the classifier.
    pub fn of_channels(
        target: &Target,
        title: &str,
        table: &Table,
        play: Play,
    ) -> Result<Self, RecordingError> {
        let config = ServeConfig::of(table)?;
        let fingers: Vec<&str> = config.fingers.iter().map(String::as_str).collect();
        Self::open(target, title, &fingers, TimeOrigin::Epoch, play)
    }

    /// Sets rows and columns of the taxels. The default is a square or a single row.
    pub fn set_shape(&mut self, rows: usize, cols: usize) {
        for finger in &mut self.fingers {
            finger.skin.set_shape(rows, cols);
        }
    }

    /// Shows a packet. Frames and beliefs are buffered until [`Scene::flush`] at the latest.
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn show(&mut self, entry: &Entry) -> Result<(), RecordingError> {
        let time_ns = entry.time_ns as i64;
        match &entry.packet {
            RecordedPacket::Frame(frame) => {
                let mut fingers = self.fingers.iter_mut();
                match fingers.find(|finger| *finger.id == *entry.channel) {
                    Some(finger) => finger.skin.show(&self.stream, &finger.id, time_ns, frame),
                    None => Ok(()),
                }
            }
            RecordedPacket::Belief(belief) => {
                if let Some(finger) = self.fingers.get_mut(belief.finger as usize) {
                    finger.beliefs.show(time_ns, belief, &self.materials);
                }
                Ok(())
            }
            RecordedPacket::Status(status) => self.show_status(time_ns, status),
            RecordedPacket::Model(model) => self.show_model(model),
            RecordedPacket::Command(command) => self.show_command(time_ns, command),
            RecordedPacket::Plain(_) => Ok(()),
        }
    }

    /// Shows consecutive frames of a finger. The lines are interrupted after them.
    ///
    /// - `finger`: index among the scene's fingers
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn show_stretch(&mut self, finger: usize, stretch: Stretch) -> Result<(), RecordingError> {
        let finger = &mut self.fingers[finger];
        finger.skin.show_stretch(&self.stream, &finger.id, stretch)
    }

    /// Writes a line into the log of events.
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn say(&self, time_ns: i64, line: &str) -> Result<(), RecordingError> {
        let line = TextLog::new(line).columns_of_unit_batches();
        self.stream
            .send("events", [self.stream.times(vec![time_ns])], line)
    }

    /// Sends all buffered data.
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn flush(&mut self) -> Result<(), RecordingError> {
        for finger in &mut self.fingers {
            finger.skin.send(&self.stream, &finger.id)?;
            finger.beliefs.send(&self.stream, &finger.id)?;
        }
        Ok(())
    }

    /// Returns true if the viewer or the file has received everything within `patience`.
    ///
    /// # Errors
    /// The viewer has gone; the file cannot be written.
    pub fn has_arrived(&self, patience: Duration) -> Result<bool, RecordingError> {
        match self.stream.recording.flush_with_timeout(patience) {
            Ok(()) => Ok(true),
            Err(SinkFlushError::Timeout) => Ok(false),
            Err(error) => Err(self.target.broken(&error.to_string())),
        }
    }

    /// Sends all buffered data and waits until it has arrived, without a timeout.
    ///
    /// # Errors
    /// The same as [`Scene::has_arrived`].
    pub fn finish(mut self) -> Result<(), RecordingError> {
        self.flush()?;
        while !self.has_arrived(ASKED_EVERY)? {}
        Ok(())
    }

    fn show_model(&mut self, model: &ModelNames) -> Result<(), RecordingError> {
        // Earlier beliefs keep the earlier names.
        self.flush()?;
        self.materials = model.names[..(model.materials as usize).min(model.names.len())]
            .iter()
            .map(|name| name.as_str().to_string())
            .collect();
        self.set_shape(model.rows as usize, model.cols as usize);
        for finger in &self.fingers {
            BeliefColumns::name(&self.stream, &finger.id, &self.materials)?;
        }
        Ok(())
    }

    fn show_status(&self, time_ns: i64, status: &TactileStatus) -> Result<(), RecordingError> {
        let text = match status.text.as_str() {
            "" if status.event == Event::Classified as u32 => "classified",
            // A periodic status is not an event.
            "" => return Ok(()),
            text => text,
        };
        self.say(time_ns, &format!("sweep {}: {text}", status.sweep))
    }

    fn show_command(&self, time_ns: i64, command: &SweepCommand) -> Result<(), RecordingError> {
        let line = match (command.command(), command.material.as_str()) {
            (None, _) => format!("command {}", command.kind),
            (Some(kind), "") => format!("{kind:?}"),
            (Some(Command::Start), material) => format!("Start, over {material}"),
            (Some(kind), material) => format!("{kind:?} {material}"),
        };
        self.say(
            time_ns,
            &format!("command of motion {}: {line}", command.motion),
        )
    }
}
