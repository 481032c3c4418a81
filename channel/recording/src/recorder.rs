//! Recorder of channels: one thread follows the channels, one compresses and writes.
//!
//! ```text
//! channels whose packets are described ──> Recorder::step ── at most 8192 messages wait ──> writer ──> FILE.mcap
//! ```
//!
//! A chunk lasts at most one second. A killed recorder loses that much, plus the messages that wait for a slow disk.
//! If the disk is too slow for long, the rings of the channels keep the newest packets and count lost ones.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tactnet_channel::{Bus, Packet, Table, now_ns};
use tactnet_skin::packets::{SkinFrame, TactileBelief};

use crate::described_channels::{Channel, DescribedChannels};
use crate::{EPOCH, METADATA, RecordingError};

/// Maximum number of messages that wait for the writer.
const WAITING: usize = 8192;
/// Maximum duration of a chunk.
const CHUNK_EVERY: Duration = Duration::from_secs(1);
/// Size at which a chunk ends, in bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// Metadata of a recording.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// Material under the fingers, if it is the same all the time.
    pub material: Option<String>,
    /// Git commit of the program.
    pub git: String,
    /// Files to keep in the recording, by name: those of the serving classifier.
    pub files: Vec<(String, Vec<u8>)>,
}

/// Counts of recorded messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Number of followed channels.
    pub channels: usize,
    /// Messages on all channels.
    pub messages: u64,
    /// Frames of the skin.
    pub frames: u64,
    /// Beliefs.
    pub beliefs: u64,
    /// Packets that were put and never arrived.
    pub lost: u64,
}

struct Piece {
    channel: u16,
    sequence: u32,
    log_time: u64,
    publish_time: u64,
    data: Vec<u8>,
}

/// A channel of the file.
#[derive(Debug)]
struct FileChannel {
    id: u16,
    /// Number of messages so far, which wraps.
    messages: u32,
}

/// Writes the packets of all described channels of a table to a file.
pub struct Recorder {
    followed: DescribedChannels,
    channels: Vec<FileChannel>,
    /// Start of the recording, in nanoseconds since 1970.
    begun_ns: u64,
    counts: Counts,
    path: PathBuf,
    writer: Option<(SyncSender<Piece>, JoinHandle<mcap::McapResult<()>>)>,
}

impl Recorder {
    /// Opens the channels and creates the file.
    ///
    /// # Errors
    /// The file exists or cannot be written; no hub runs; no channel of the table can be recorded.
    pub fn start(
        bus: &Bus,
        table: &Table,
        path: &Path,
        about: &About,
    ) -> Result<Self, RecordingError> {
        let followed = DescribedChannels::open(bus, table)?;
        let file = File::create_new(path).map_err(|source| RecordingError::Io {
            path: path.into(),
            source,
        })?;
        let failed = |source| RecordingError::Write {
            path: path.into(),
            source,
        };
        let mut writer = write_options()
            .create(BufWriter::new(file))
            .map_err(failed)?;
        let begun_ns = followed.epoch_ns + now_ns();
        writer
            .write_metadata(&metadata(table, about, followed.epoch_ns)?)
            .map_err(failed)?;
        for (name, data) in &about.files {
            writer
                .attach(&Attachment {
                    log_time: begun_ns,
                    create_time: begun_ns,
                    name: name.clone(),
                    media_type: "application/octet-stream".into(),
                    data: data.into(),
                })
                .map_err(failed)?;
        }
        let channels = add_channels(&mut writer, followed.channels()).map_err(failed)?;
        writer.flush().map_err(failed)?;
        let (sender, pieces) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("recording".into())
            .spawn(move || write(writer, &pieces))
            .map_err(|source| RecordingError::Io {
                path: path.into(),
                source,
            })?;
        let counts = Counts {
            channels: followed.channels().len(),
            ..Counts::default()
        };
        Ok(Self {
            followed,
            channels,
            begun_ns,
            counts,
            path: path.into(),
            writer: Some((sender, thread)),
        })
    }

    /// Waits for packets, at most for `patience`, and passes them to the writer.
    ///
    /// # Errors
    /// The channels have failed; the file cannot be written, for example because the disk is full.
    pub fn step(&mut self, patience: Duration) -> Result<(), RecordingError> {
        self.followed.wait(patience)?;
        self.follow()
    }

    fn follow(&mut self) -> Result<(), RecordingError> {
        let Some((writer, _)) = &self.writer else {
            return Ok(());
        };
        let mut is_writing = true;
        let followed = self.followed.channels();
        self.followed.follow(|place, put_ns, packet| {
            let channel = &mut self.channels[place];
            let kind = followed[place].kind;
            let piece = Piece {
                channel: channel.id,
                sequence: channel.messages,
                // Packets from the history must not extend the recording to the past.
                log_time: put_ns.max(self.begun_ns),
                publish_time: put_ns,
                data: kind.to_message(packet),
            };
            channel.messages = channel.messages.wrapping_add(1);
            self.counts.messages += 1;
            match kind.layout.name {
                SkinFrame::NAME => self.counts.frames += 1,
                TactileBelief::NAME => self.counts.beliefs += 1,
                _ => {}
            }
            is_writing &= writer.send(piece).is_ok();
        })?;
        if is_writing { Ok(()) } else { self.end() }
    }

    /// Returns the counts so far.
    pub fn counts(&self) -> Counts {
        Counts {
            lost: self.followed.lost(),
            ..self.counts
        }
    }

    /// Records the remaining packets and ends the file properly.
    ///
    /// # Errors
    /// The same as [`Recorder::step`].
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
    /// Ends the file properly in every case, so that all recorded messages stay readable.
    fn drop(&mut self) {
        let _ = self.end();
    }
}

fn write_options() -> WriteOptions {
    WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(1)
        // No extra threads: the writer's thread compresses.
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
        .library(concat!("tactnet ", env!("CARGO_PKG_VERSION")))
}

/// Adds schemas and channels to the file.
fn add_channels(
    writer: &mut Writer<BufWriter<File>>,
    channels: &[Channel],
) -> mcap::McapResult<Vec<FileChannel>> {
    let add = |channel: &Channel| {
        let kind = channel.kind;
        let schema = writer.add_schema(&kind.message, "protobuf", kind.schema)?;
        let id = writer.add_channel(schema, &channel.id, "protobuf", &BTreeMap::new())?;
        Ok(FileChannel { id, messages: 0 })
    };
    channels.iter().map(add).collect()
}

fn metadata(table: &Table, about: &About, epoch_ns: u64) -> Result<Metadata, RecordingError> {
    let text = toml::to_string(table)?;
    let mut metadata = BTreeMap::from([
        ("table".to_owned(), text),
        ("version".to_owned(), env!("CARGO_PKG_VERSION").to_owned()),
        ("git".to_owned(), about.git.clone()),
        (EPOCH.to_owned(), epoch_ns.to_string()),
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
