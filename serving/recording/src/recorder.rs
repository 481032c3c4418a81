//! Channels into a file: one thread follows the channels, one compresses and writes.
//!
//! ```text
//! skin/…, sweep/command, tactile/… ──> Recorder::step ── at most 8192 messages wait ──> writer ──> FILE.mcap
//! ```
//!
//! A chunk is ended every second at the latest, so that much is lost when the recorder is killed, besides what waits for a slow disk. When the disk
//! is slower for long, the channels' own rings keep the newest packets and count what was lost.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tactnet_channel::{Bus, GetPort, GetSide, Start, SyncGroup, Table, Wait, now_ns};
use tactnet_serving::ServeConfig;
use tactnet_serving::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};

use crate::messages::{DESCRIPTION, Recordable};
use crate::{METADATA, RecordingError};

/// Messages that wait for the writer.
const WAITING: usize = 8192;
/// A chunk is ended after this time at the latest.
const CHUNK_EVERY: Duration = Duration::from_secs(1);
/// And when it is so large, bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// Packets of a channel in one go.
const MOST: usize = 256;

/// What is known of a recording before it begins.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// What is swept over, where it is one material only.
    pub material: Option<String>,
    /// Commit of the program.
    pub git: String,
    /// Files that are kept with it, by name: the classifier that serves.
    pub files: Vec<(String, Vec<u8>)>,
}

/// What has been recorded.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Messages on all channels.
    pub messages: u64,
    /// Frames of the skin among them.
    pub frames: u64,
    /// Beliefs among them.
    pub beliefs: u64,
    /// Packets that were put and never came.
    pub lost: u64,
}

struct Piece {
    channel: u16,
    sequence: u32,
    log_time: u64,
    publish_time: u64,
    data: Vec<u8>,
}

/// From the channels' clock to the time of day.
#[derive(Clone, Copy)]
struct Clock {
    /// Nanoseconds since 1970 when the channels' clock was zero.
    epoch_ns: u64,
    /// When the recording began, by the channels' clock.
    begun_ns: u64,
}

/// Follows the channels of the classifier and writes what travels on them.
pub struct Recorder {
    group: SyncGroup,
    frames: Vec<RecordedChannel<SkinFrame>>,
    commands: RecordedChannel<SweepCommand>,
    beliefs: RecordedChannel<TactileBelief>,
    status: RecordedChannel<TactileStatus>,
    model: RecordedChannel<ModelNames>,
    clock: Clock,
    path: PathBuf,
    writer: Option<(SyncSender<Piece>, JoinHandle<mcap::McapResult<()>>)>,
}

struct RecordedChannel<T> {
    port: GetPort<T>,
    channel: u16,
    came: u32,
}

impl<T: Recordable> RecordedChannel<T> {
    fn open(bus: &Bus, id: &str, start: Start) -> Result<Self, RecordingError> {
        Ok(Self {
            port: bus.get_port(id, start)?,
            channel: 0,
            came: 0,
        })
    }

    /// Says in the file what it holds.
    fn describe(&mut self, writer: &mut Writer<BufWriter<File>>, id: &str) -> mcap::McapResult<()> {
        let schema = writer.add_schema(T::MESSAGE, "protobuf", DESCRIPTION)?;
        self.channel = writer.add_channel(schema, id, "protobuf", &BTreeMap::new())?;
        Ok(())
    }

    /// Hands on what has come; false when the writer is gone.
    fn follow(&mut self, clock: Clock, writer: &SyncSender<Piece>) -> Result<bool, RecordingError> {
        for _ in 0..MOST {
            let Some(packet) = self.port.try_get()? else {
                break;
            };
            let header = *packet.header();
            // Another host's clock says nothing here.
            let put_ns = if header.remote == 0 {
                header.put_ns
            } else {
                now_ns()
            };
            for packet in &*packet {
                let piece = Piece {
                    channel: self.channel,
                    sequence: self.came,
                    // What was put before, as history, does not stretch the recording.
                    log_time: clock.epoch_ns + put_ns.max(clock.begun_ns),
                    publish_time: clock.epoch_ns + put_ns,
                    data: packet.to_message(),
                };
                self.came = self.came.wrapping_add(1);
                if writer.send(piece).is_err() {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }
}

impl Recorder {
    /// Opens the channels and begins a file.
    ///
    /// # Errors
    /// A file that is there already or cannot be written; no hub; channels missing in the table.
    pub fn start(
        bus: &Bus,
        table: &Table,
        path: &Path,
        about: &About,
    ) -> Result<Self, RecordingError> {
        let config = ServeConfig::of(table)?;
        let mut frames = config
            .fingers
            .iter()
            .map(|id| RecordedChannel::open(bus, id, Start::Now))
            .collect::<Result<Vec<_>, _>>()?;
        let mut commands = RecordedChannel::open(bus, &config.command, Start::Now)?;
        let mut beliefs = RecordedChannel::open(bus, &config.belief, Start::Now)?;
        let mut status = RecordedChannel::open(bus, &config.status, Start::Now)?;
        // It was put when the service began.
        let mut model = RecordedChannel::open(bus, &config.model, Start::History(1))?;
        let mut sides: Vec<&dyn GetSide> = Vec::new();
        sides.extend(
            frames
                .iter()
                .map(|f: &RecordedChannel<SkinFrame>| &f.port as &dyn GetSide),
        );
        sides.extend([
            &commands.port as &dyn GetSide,
            &beliefs.port,
            &status.port,
            &model.port,
        ]);
        let group = bus.sync_group(&sides)?;

        let file = File::create_new(path).map_err(|source| RecordingError::Io {
            path: path.into(),
            source,
        })?;
        let failed = |source| RecordingError::Write {
            path: path.into(),
            source,
        };
        let options = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_level(1)
            // In the writer's own thread.
            .compression_threads(0)
            .chunk_size(Some(CHUNK_BYTES))
            .library(concat!("tactnet ", env!("CARGO_PKG_VERSION")));
        let mut writer = options.create(BufWriter::new(file)).map_err(failed)?;
        let begun_ns = now_ns();
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let clock = Clock {
            epoch_ns: since
                .map_or(0, |since| since.as_nanos() as u64)
                .saturating_sub(begun_ns),
            begun_ns,
        };
        writer
            .write_metadata(&metadata(table, about)?)
            .map_err(failed)?;
        for (name, data) in &about.files {
            let log_time = clock.epoch_ns + begun_ns;
            writer
                .attach(&Attachment {
                    log_time,
                    create_time: log_time,
                    name: name.clone(),
                    media_type: "application/octet-stream".into(),
                    data: data.into(),
                })
                .map_err(failed)?;
        }
        for (id, frames) in config.fingers.iter().zip(&mut frames) {
            frames.describe(&mut writer, id).map_err(failed)?;
        }
        commands
            .describe(&mut writer, &config.command)
            .map_err(failed)?;
        beliefs
            .describe(&mut writer, &config.belief)
            .map_err(failed)?;
        status
            .describe(&mut writer, &config.status)
            .map_err(failed)?;
        model.describe(&mut writer, &config.model).map_err(failed)?;
        writer.flush().map_err(failed)?;
        let (sender, pieces) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("recording".into())
            .spawn(move || write(writer, &pieces))
            .map_err(|source| RecordingError::Io {
                path: path.into(),
                source,
            })?;
        Ok(Self {
            group,
            frames,
            commands,
            beliefs,
            status,
            model,
            clock,
            path: path.into(),
            writer: Some((sender, thread)),
        })
    }

    /// Waits for packets and hands on all that have come; returns after `patience` at the latest.
    ///
    /// # Errors
    /// The channels have broken down; the file cannot be written any more, for example because the disk is full.
    pub fn step(&mut self, patience: Duration) -> Result<(), RecordingError> {
        self.group.wait(Wait::Block { timeout: patience })?;
        self.follow()
    }

    fn follow(&mut self) -> Result<(), RecordingError> {
        let Some((writer, _)) = &self.writer else {
            return Ok(());
        };
        // What a command or a belief is about comes before it or with it.
        let mut goes_on = self.commands.follow(self.clock, writer)?;
        for frames in &mut self.frames {
            goes_on &= frames.follow(self.clock, writer)?;
        }
        goes_on &= self.beliefs.follow(self.clock, writer)?;
        goes_on &= self.status.follow(self.clock, writer)?;
        goes_on &= self.model.follow(self.clock, writer)?;
        if goes_on { Ok(()) } else { self.end() }
    }

    /// What has come so far.
    pub fn counts(&self) -> Counts {
        let frames: u64 = self.frames.iter().map(|f| u64::from(f.came)).sum();
        let others = [
            self.commands.came,
            self.beliefs.came,
            self.status.came,
            self.model.came,
        ];
        Counts {
            messages: frames + others.into_iter().map(u64::from).sum::<u64>(),
            frames,
            beliefs: self.beliefs.came.into(),
            lost: self.frames.iter().map(|f| f.port.lost()).sum::<u64>()
                + self.commands.port.lost()
                + self.beliefs.port.lost()
                + self.status.port.lost()
                + self.model.port.lost(),
        }
    }

    /// Takes what is still there, and ends the file properly.
    ///
    /// # Errors
    /// As [`Recorder::step`].
    pub fn finish(mut self) -> Result<Counts, RecordingError> {
        self.follow()?;
        self.end()?;
        Ok(self.counts())
    }

    fn end(&mut self) -> Result<(), RecordingError> {
        let Some((sender, thread)) = self.writer.take() else {
            return Ok(());
        };
        drop(sender);
        match thread.join() {
            Ok(outcome) => outcome.map_err(|source| RecordingError::Write {
                path: self.path.clone(),
                source,
            }),
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

impl Drop for Recorder {
    /// What has come is kept, however it ends.
    fn drop(&mut self) {
        let _ = self.end();
    }
}

fn metadata(table: &Table, about: &About) -> Result<Metadata, RecordingError> {
    let text = toml::to_string(table)
        .map_err(|error| tactnet_serving::ServeError::Config(error.to_string()))?;
    let mut metadata = BTreeMap::from([
        ("table".to_owned(), text),
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("git".to_owned(), about.git.clone()),
    ]);
    if let Some(material) = &about.material {
        metadata.insert("material".into(), material.clone());
    }
    Ok(Metadata {
        name: METADATA.into(),
        metadata,
    })
}

fn write(mut writer: Writer<BufWriter<File>>, pieces: &Receiver<Piece>) -> mcap::McapResult<()> {
    let mut ended = Instant::now();
    loop {
        let left = CHUNK_EVERY.saturating_sub(ended.elapsed());
        match pieces.recv_timeout(left) {
            Ok(piece) => writer.write_to_known_channel(
                &MessageHeader {
                    channel_id: piece.channel,
                    sequence: piece.sequence,
                    log_time: piece.log_time,
                    publish_time: piece.publish_time,
                },
                &piece.data,
            )?,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                writer.finish()?;
                return Ok(());
            }
        }
        if ended.elapsed() >= CHUNK_EVERY {
            writer.flush()?;
            ended = Instant::now();
        }
    }
}
