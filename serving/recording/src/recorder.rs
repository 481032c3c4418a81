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
use std::time::{Duration, Instant};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tactnet_channel::{Bus, Table};

use crate::messages::DESCRIPTION;
use crate::{Listener, METADATA, RecordedPacket, RecordingError};

/// Messages that wait for the writer.
const WAITING: usize = 8192;
/// A chunk is ended after this time at the latest.
const CHUNK_EVERY: Duration = Duration::from_secs(1);
/// And when it is so large, bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// Facts about a recording that are known before it begins.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// The material that is swept over, where it is one material only.
    pub material: Option<String>,
    /// Commit of the program.
    pub git: String,
    /// Files that are kept with it, by name: the classifier that serves.
    pub files: Vec<(String, Vec<u8>)>,
}

/// Counts of what has been recorded.
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

/// Follows the channels of the classifier and writes what travels on them.
pub struct Recorder {
    listener: Listener,
    /// Of each channel its number in the file and how many messages have come.
    channels: Vec<(u16, u32)>,
    /// Nanoseconds since 1970.
    begun_ns: u64,
    counts: Counts,
    path: PathBuf,
    writer: Option<(SyncSender<Piece>, JoinHandle<mcap::McapResult<()>>)>,
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
        let listener = Listener::open(bus, table)?;
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
        let begun_ns = listener.now_ns();
        writer
            .write_metadata(&metadata(table, about)?)
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
        let channels = listener
            .channels()
            .iter()
            .map(|(id, message)| {
                let schema = writer.add_schema(message, "protobuf", &DESCRIPTION)?;
                let channel = writer.add_channel(schema, id, "protobuf", &BTreeMap::new())?;
                Ok((channel, 0))
            })
            .collect::<mcap::McapResult<_>>()
            .map_err(failed)?;
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
            listener,
            channels,
            begun_ns,
            counts: Counts::default(),
            path: path.into(),
            writer: Some((sender, thread)),
        })
    }

    /// Waits for packets and hands on all that have come; returns after `patience` at the latest.
    ///
    /// # Errors
    /// The channels have broken down; the file cannot be written any more, for example because the disk is full.
    pub fn step(&mut self, patience: Duration) -> Result<(), RecordingError> {
        self.listener.wait(patience)?;
        self.follow()
    }

    fn follow(&mut self) -> Result<(), RecordingError> {
        let Some((writer, _)) = &self.writer else {
            return Ok(());
        };
        let mut goes_on = true;
        self.listener.follow(|heard| {
            let (channel, came) = &mut self.channels[heard.channel];
            let piece = Piece {
                channel: *channel,
                sequence: *came,
                // What was put before, as history, does not stretch the recording.
                log_time: heard.put_ns.max(self.begun_ns),
                publish_time: heard.put_ns,
                data: heard.packet.to_message(),
            };
            *came = came.wrapping_add(1);
            self.counts.messages += 1;
            match heard.packet {
                RecordedPacket::Frame(_) => self.counts.frames += 1,
                RecordedPacket::Belief(_) => self.counts.beliefs += 1,
                _ => {}
            }
            goes_on &= writer.send(piece).is_ok();
        })?;
        if goes_on { Ok(()) } else { self.end() }
    }

    /// Returns the counts so far.
    pub fn counts(&self) -> Counts {
        Counts {
            lost: self.listener.lost(),
            ..self.counts
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
    /// Keeps all that has come, however it ends.
    fn drop(&mut self) {
        let _ = self.end();
    }
}

fn metadata(table: &Table, about: &About) -> Result<Metadata, RecordingError> {
    let text = toml::to_string(table)?;
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
