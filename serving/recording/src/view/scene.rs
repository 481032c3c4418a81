//! Frames, beliefs and events as columns of the viewer.

use std::time::Duration;

use re_sdk::log::{ChunkBatcherConfig, TimeColumn};
use re_sdk::{
    AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder, SerializationError,
    SerializedComponentColumn, SpawnOptions,
};
use re_sdk_types::archetypes::{Scalars, SeriesLines, Tensor, TextDocument, TextLog};
use re_sdk_types::blueprint::components::PlayState;
use re_sdk_types::components::ValueRange;
use re_sdk_types::datatypes::{TensorBuffer, TensorData};
use tactnet_serving::packets::{
    Command, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus,
};

use super::{Target, ViewError, bars, layout};
use crate::{Entry, RecordedPacket};

/// Frames that wait at most until they are sent together.
const TOGETHER: usize = 4096;
/// Between two heatmaps, nanoseconds.
const HEATMAP_EVERY: i64 = 40_000_000;
/// What the viewer's library may hold back, bytes.
const HELD_BACK: u64 = 32 << 20;
/// How long the viewer may take for what is left.
const PATIENCE: Duration = Duration::from_secs(20);

/// What zero means on the timeline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TimeOrigin {
    /// The year 1970: things happened at a time of day.
    Epoch,
    /// The first sweep.
    Begin,
}

/// Frames of one finger that follow each other.
#[derive(Debug, Clone, Default)]
pub struct Stretch {
    /// `[frames]`, nanoseconds since the scene's origin.
    pub times_ns: Vec<i64>,
    /// `[frames]`.
    pub sequences: Vec<i64>,
    /// `[frames][taxels]`.
    pub digits: Vec<f32>,
}

/// A finger as it is drawn.
struct Finger {
    id: String,
    waiting: Stretch,
    /// Smallest and largest digits so far.
    range: [f64; 2],
    drawn_ns: i64,
    taxels: usize,
}

/// What is shown in one viewer or file.
pub struct Scene {
    stream: RecordingStream,
    target: Target,
    origin: TimeOrigin,
    fingers: Vec<Finger>,
    shape: Option<[usize; 2]>,
    materials: Vec<String>,
}

/// The probabilities that count.
pub(super) fn posterior(belief: &TactileBelief) -> &[f32] {
    &belief.posterior[..(belief.materials as usize).min(belief.posterior.len())]
}

impl Scene {
    /// - `title`: what the viewer calls it
    /// - `fingers`: ids of their channels
    /// - `live`: time follows what comes; else it runs from the beginning
    ///
    /// # Errors
    /// No viewer there; a file that is there already.
    pub fn open(
        target: &Target,
        title: &str,
        fingers: &[&str],
        origin: TimeOrigin,
        live: bool,
    ) -> Result<Self, ViewError> {
        let play = if live {
            PlayState::Following
        } else {
            PlayState::Playing
        };
        let mut batching = ChunkBatcherConfig::LOW_LATENCY;
        batching.max_bytes_in_flight = HELD_BACK;
        let builder = RecordingStreamBuilder::new("tactnet")
            .recording_name(title)
            .batcher_config(batching)
            .with_blueprint(layout::blueprint(fingers, origin, play));
        let stream = match target {
            Target::Viewer { memory_limit } => builder.spawn_opts(&SpawnOptions {
                memory_limit: memory_limit.clone(),
                server_memory_limit: memory_limit.clone(),
                // It would listen to everybody.
                extra_args: vec!["--bind=127.0.0.1".into()],
                new: true,
                wait_for_bind: true,
                ..SpawnOptions::default()
            })?,
            Target::Connect { url } => builder.connect_grpc_opts(url.as_str())?,
            Target::File { path } if path.exists() => {
                return Err(ViewError::Exists { path: path.clone() });
            }
            Target::File { path } => builder.save(path).map_err(|error| ViewError::Write {
                path: path.clone(),
                reason: error.to_string(),
            })?,
        };
        for id in fingers {
            stream.log_static(format!("{id}/belief/bars/outline"), &bars::outline())?;
            for stage in ["plain", "dropout"] {
                stream.log_static(
                    format!("{id}/latency/{stage}"),
                    &SeriesLines::new().with_names([stage]),
                )?;
            }
        }
        let scene = Self {
            stream,
            target: target.clone(),
            origin,
            fingers: fingers
                .iter()
                .map(|id| Finger {
                    id: (*id).into(),
                    waiting: Stretch::default(),
                    range: [f64::INFINITY, f64::NEG_INFINITY],
                    drawn_ns: i64::MIN,
                    taxels: 0,
                })
                .collect(),
            shape: None,
            materials: Vec::new(),
        };
        // Whether anybody is there.
        scene.wait()?;
        Ok(scene)
    }

    /// Rows and columns of taxels; a square or a row is guessed where nobody says.
    pub fn set_shape(&mut self, rows: usize, cols: usize) {
        self.shape = Some([rows, cols]);
    }

    /// Shows a packet; frames are sent together, at the latest by [`Scene::flush`].
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn show(&mut self, entry: &Entry) -> Result<(), ViewError> {
        let time_ns = entry.time_ns as i64;
        match &entry.packet {
            RecordedPacket::Frame(frame) => self.show_frame(&entry.channel, time_ns, frame),
            RecordedPacket::Belief(belief) => self.show_belief(time_ns, belief),
            RecordedPacket::Status(status) => self.show_status(time_ns, status),
            RecordedPacket::Model(model) => self.show_model(model),
            RecordedPacket::Command(command) => self.show_command(time_ns, command),
        }
    }

    fn show_frame(&mut self, id: &str, time_ns: i64, frame: &SkinFrame) -> Result<(), ViewError> {
        let Some(number) = self.fingers.iter().position(|finger| finger.id == id) else {
            return Ok(());
        };
        let (waiting, taxels) = (&self.fingers[number].waiting, self.fingers[number].taxels);
        let another = taxels != 0 && taxels != frame.values().len();
        if waiting.times_ns.len() >= TOGETHER || another {
            self.send(number)?;
        }
        let finger = &mut self.fingers[number];
        if finger.taxels != frame.values().len() {
            finger.taxels = frame.values().len();
        }
        finger.waiting.times_ns.push(time_ns);
        finger.waiting.sequences.push(frame.sequence as i64);
        finger.waiting.digits.extend_from_slice(frame.values());
        Ok(())
    }

    /// Shows many frames of a finger at once.
    ///
    /// - `finger`: its place among the scene's fingers
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn show_stretch(&mut self, finger: usize, stretch: Stretch) -> Result<(), ViewError> {
        self.send(finger)?;
        self.fingers[finger].taxels = stretch
            .digits
            .len()
            .checked_div(stretch.times_ns.len())
            .unwrap_or(0);
        self.fingers[finger].waiting = stretch;
        self.send(finger)
    }

    /// Writes a line into the log of events.
    ///
    /// # Errors
    /// The viewer's library refuses it.
    pub fn say(&self, time_ns: i64, line: &str) -> Result<(), ViewError> {
        self.put("events", time_ns, &TextLog::new(line))
    }

    /// Sends the frames that wait.
    ///
    /// # Errors
    /// The viewer's library refuses them.
    pub fn flush(&mut self) -> Result<(), ViewError> {
        (0..self.fingers.len()).try_for_each(|finger| self.send(finger))
    }

    /// Waits until the viewer, or the file, has what was sent.
    ///
    /// # Errors
    /// The viewer has gone, or takes too long; the file cannot be written.
    pub fn wait(&self) -> Result<(), ViewError> {
        self.stream
            .flush_with_timeout(PATIENCE)
            .map_err(|error| match &self.target {
                Target::File { path } => ViewError::Write {
                    path: path.clone(),
                    reason: error.to_string(),
                },
                _ => ViewError::Gone(error.to_string()),
            })
    }

    /// Sends what is left and waits for it.
    ///
    /// # Errors
    /// As [`Scene::wait`].
    pub fn finish(mut self) -> Result<(), ViewError> {
        self.flush()?;
        self.wait()
    }

    fn times(&self, times_ns: Vec<i64>) -> TimeColumn {
        match self.origin {
            TimeOrigin::Epoch => TimeColumn::new_timestamp_nanos_since_epoch("time", times_ns),
            TimeOrigin::Begin => TimeColumn::new_duration_nanos("time", times_ns),
        }
    }

    /// One row of one entity.
    fn put(
        &self,
        entity: impl Into<EntityPath>,
        time_ns: i64,
        what: &dyn AsComponents,
    ) -> Result<(), ViewError> {
        let columns = what
            .as_serialized_batches()
            .into_iter()
            .map(|batch| {
                let length = batch.array.len();
                batch.partitioned([length])
            })
            .collect::<Result<Vec<SerializedComponentColumn>, _>>()
            .map_err(|error| ViewError::Rerun(error.to_string()))?;
        Ok(self
            .stream
            .send_columns(entity, [self.times(vec![time_ns])], columns)?)
    }

    /// Sends the frames of a finger that wait: all traces, some heatmaps.
    fn send(&mut self, number: usize) -> Result<(), ViewError> {
        let waiting = std::mem::take(&mut self.fingers[number].waiting);
        let (frames, taxels) = (waiting.times_ns.len(), self.fingers[number].taxels);
        if frames == 0 || taxels == 0 {
            return Ok(());
        }
        let failed = |error: SerializationError| ViewError::Rerun(error.to_string());
        let [rows, cols] = match self.shape {
            Some([rows, cols]) if rows * cols == taxels => [rows, cols],
            _ => square(taxels),
        };
        let finger = &mut self.fingers[number];
        if finger.drawn_ns == i64::MIN {
            let names = (0..taxels).map(|taxel| format!("{}, {}", taxel / cols, taxel % cols));
            self.stream.log_static(
                format!("{}/traces", finger.id),
                &SeriesLines::new().with_names(names),
            )?;
        }
        let mut heatmaps = Vec::new();
        for (time_ns, digits) in waiting.times_ns.iter().zip(waiting.digits.chunks(taxels)) {
            for digit in digits.iter().filter(|digit| digit.is_finite()) {
                let [low, high] = finger.range;
                finger.range = [low.min(f64::from(*digit)), high.max(f64::from(*digit))];
            }
            if *time_ns >= finger.drawn_ns.saturating_add(HEATMAP_EVERY)
                || *time_ns < finger.drawn_ns
            {
                finger.drawn_ns = *time_ns;
                let shape = vec![rows as u64, cols as u64];
                let buffer = TensorBuffer::F32(digits.to_vec().into());
                let data = TensorData::new(shape, buffer).with_dim_names(["row", "col"]);
                heatmaps.push((*time_ns, data, finger.range));
            }
        }
        let id = finger.id.clone();
        let traces = Scalars::update_fields()
            .with_scalars(waiting.digits.iter().map(|digit| f64::from(*digit)))
            .columns(std::iter::repeat_n(taxels, frames))
            .map_err(failed)?;
        let indexes = [
            self.times(waiting.times_ns),
            TimeColumn::new_sequence("frame", waiting.sequences),
        ];
        self.stream
            .send_columns(format!("{id}/traces"), indexes, traces)?;
        let times = self.times(heatmaps.iter().map(|(time_ns, ..)| *time_ns).collect());
        let ranges = heatmaps
            .iter()
            .map(|(.., range)| ValueRange::from([range[0], range[1].max(range[0] + 1e-6)]));
        let heatmaps = Tensor::update_fields()
            .with_many_value_range(ranges)
            .with_many_data(heatmaps.iter().map(|(_, data, _)| data.clone()))
            .columns_of_unit_batches()
            .map_err(failed)?;
        self.stream
            .send_columns(format!("{id}/heatmap"), [times], heatmaps)?;
        Ok(())
    }

    fn show_model(&mut self, model: &ModelNames) -> Result<(), ViewError> {
        self.materials = model.names[..(model.materials as usize).min(model.names.len())]
            .iter()
            .map(|name| name.as_str().to_string())
            .collect();
        self.set_shape(model.rows as usize, model.cols as usize);
        for finger in &self.fingers {
            self.stream.log_static(
                format!("{}/belief/posterior", finger.id),
                &SeriesLines::new().with_names(self.materials.iter().map(String::as_str)),
            )?;
        }
        Ok(())
    }

    fn show_belief(&mut self, time_ns: i64, belief: &TactileBelief) -> Result<(), ViewError> {
        let Some(finger) = self.fingers.get(belief.finger as usize) else {
            return Ok(());
        };
        let (id, posterior) = (&finger.id, posterior(belief));
        let (drawn, names) = bars::drawn(&bars::likeliest(posterior, &self.materials));
        self.put(format!("{id}/belief/bars/length"), time_ns, &drawn)?;
        self.put(format!("{id}/belief/bars/name"), time_ns, &names)?;
        let words = TextDocument::from_markdown(bars::words(belief, &self.materials));
        self.put(format!("{id}/belief/text"), time_ns, &words)?;
        let lines = Scalars::new(posterior.iter().map(|p| f64::from(*p)));
        self.put(format!("{id}/belief/posterior"), time_ns, &lines)?;
        if belief.stage != Stage::Anytime as u32 {
            let stage = if belief.stage == Stage::Plain as u32 {
                "plain"
            } else {
                "dropout"
            };
            let latency = Scalars::new([belief.latency_ns as f64 / 1e6]);
            self.put(format!("{id}/latency/{stage}"), time_ns, &latency)?;
        }
        Ok(())
    }

    fn show_status(&self, time_ns: i64, status: &TactileStatus) -> Result<(), ViewError> {
        let text = match status.text.as_str() {
            "" if status.event == Event::Judged as u32 => "judged",
            // Once a second, or told by others.
            "" => return Ok(()),
            text => text,
        };
        self.say(time_ns, &format!("sweep {}: {text}", status.sweep))
    }

    fn show_command(&self, time_ns: i64, command: &SweepCommand) -> Result<(), ViewError> {
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

/// Rows and columns of so many taxels.
fn square(taxels: usize) -> [usize; 2] {
    let side = taxels.isqrt();
    if side * side == taxels {
        [side, side]
    } else {
        [1, taxels]
    }
}
