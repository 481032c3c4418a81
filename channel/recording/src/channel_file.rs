//! File of a recording: one thread compresses and writes the messages that another one passes on.
//!
//! A chunk lasts at most one second. A killed process loses that much, plus the messages that wait for a slow disk.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, Compression, WriteOptions, Writer};
use tactnet_channel::Table;

use crate::described_channels::{Channel, DescribedChannels};
use crate::recorder::About;
use crate::{EPOCH, METADATA, RecordingError, SENDER};

/// Maximum number of messages that wait for the writer.
const WAITING: usize = 8192;
/// Maximum duration of a chunk.
const CHUNK_EVERY: Duration = Duration::from_secs(1);
/// Size at which a chunk ends, in bytes.
const CHUNK_BYTES: u64 = 1 << 20;
/// Maximum number of pairs of channel and put-port with a separate entry in the file; MCAP numbers them with 16 bits.
/// Messages of further put-ports have no sender.
const MAX_SENDERS: usize = 60_000;

/// A message on its way to the file.
pub(crate) struct Piece {
    /// Index of its channel.
    pub place: usize,
    /// Random number of the put-port.
    pub sender: u64,
    /// Time in the recording, in nanoseconds since 1970.
    pub log_time: u64,
    /// Time of the put, in nanoseconds since 1970.
    pub publish_time: u64,
    pub data: Vec<u8>,
}

/// A file that is being written.
pub(crate) struct ChannelFile {
    path: PathBuf,
    /// Absent after the end.
    writer: Option<(SyncSender<Piece>, JoinHandle<mcap::McapResult<()>>)>,
}

impl ChannelFile {
    /// Creates the file with table, metadata and attachments.
    ///
    /// - `begun_ns`: begin of the recording, in nanoseconds since 1970
    ///
    /// # Errors
    /// The file exists or cannot be written.
    pub fn create(
        path: &Path,
        table: &Table,
        about: &About,
        followed: &DescribedChannels,
        begun_ns: u64,
    ) -> Result<Self, RecordingError> {
        let io_failed = |source| RecordingError::Io {
            path: path.into(),
            source,
        };
        let metadata = metadata(table, about, followed.epoch_ns)?;
        let file = File::create_new(path).map_err(io_failed)?;
        let create = || -> mcap::McapResult<Messages> {
            let mut writer = write_options().create(BufWriter::new(file))?;
            writer.write_metadata(&metadata)?;
            for (name, data) in &about.files {
                writer.attach(&Attachment {
                    log_time: begun_ns,
                    create_time: begun_ns,
                    name: name.clone(),
                    media_type: "application/octet-stream".into(),
                    data: data.into(),
                })?;
            }
            let mut messages = Messages::new(writer, followed.channels())?;
            messages.writer.flush()?;
            Ok(messages)
        };
        let messages = create().map_err(|source| RecordingError::Write {
            path: path.into(),
            source,
        })?;
        let (sender, pieces) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("recording".into())
            .spawn(move || messages.write_all(&pieces))
            .map_err(io_failed)?;
        Ok(Self {
            path: path.into(),
            writer: Some((sender, thread)),
        })
    }

    /// Passes a message to the writer, and waits while too many are waiting. Returns false if the writer has failed;
    /// [`ChannelFile::end`] returns its error.
    pub fn send(&self, piece: Piece) -> bool {
        let writer = self.writer.as_ref();
        writer.is_some_and(|(sender, _)| sender.send(piece).is_ok())
    }

    /// Passes a message to the writer. Returns it if too many are waiting.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn try_send(&mut self, piece: Piece) -> Result<Option<Piece>, RecordingError> {
        let Some((sender, _)) = &self.writer else {
            return Ok(None);
        };
        match sender.try_send(piece) {
            Ok(()) => Ok(None),
            Err(TrySendError::Full(piece)) => Ok(Some(piece)),
            Err(TrySendError::Disconnected(_)) => self.end().map(|()| None),
        }
    }

    /// Writes the waiting messages and ends the file properly. A second call does nothing.
    ///
    /// # Errors
    /// The file cannot be written, for example because the disk is full.
    pub fn end(&mut self) -> Result<(), RecordingError> {
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

impl Drop for ChannelFile {
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

/// An entry of the file for the packets of one put-port.
struct FileChannel {
    id: u16,
    /// Number of messages so far, which wraps.
    messages: u32,
}

/// Writes messages, and an entry for each pair of channel and put-port before its first message.
struct Messages {
    writer: Writer<BufWriter<File>>,
    /// Topic and schema of each channel.
    topics: Vec<(String, u16)>,
    channels: BTreeMap<(usize, u64), FileChannel>,
}

impl Messages {
    fn new(mut writer: Writer<BufWriter<File>>, channels: &[Channel]) -> mcap::McapResult<Self> {
        let topics = channels.iter().map(|channel| {
            let kind = channel.kind;
            let schema = writer.add_schema(&kind.message, "protobuf", kind.schema)?;
            Ok((channel.id.to_string(), schema))
        });
        Ok(Self {
            topics: topics.collect::<mcap::McapResult<_>>()?,
            channels: BTreeMap::new(),
            writer,
        })
    }

    fn write_all(mut self, pieces: &Receiver<Piece>) -> mcap::McapResult<()> {
        let mut ended = Instant::now();
        loop {
            let left = CHUNK_EVERY.saturating_sub(ended.elapsed());
            match pieces.recv_timeout(left) {
                Ok(piece) => self.write(&piece)?,
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => {
                    self.writer.finish()?;
                    return Ok(());
                }
            }
            if ended.elapsed() >= CHUNK_EVERY {
                self.writer.flush()?;
                ended = Instant::now();
            }
        }
    }

    fn write(&mut self, piece: &Piece) -> mcap::McapResult<()> {
        let mut key = (piece.place, piece.sender);
        if self.channels.len() >= MAX_SENDERS && !self.channels.contains_key(&key) {
            key.1 = 0;
        }
        if !self.channels.contains_key(&key) {
            let (topic, schema) = &self.topics[piece.place];
            let mut about = BTreeMap::new();
            if key.1 != 0 {
                about.insert(SENDER.to_owned(), format!("{:016x}", key.1));
            }
            let id = self
                .writer
                .add_channel(*schema, topic, "protobuf", &about)?;
            self.channels.insert(key, FileChannel { id, messages: 0 });
        }
        let Some(channel) = self.channels.get_mut(&key) else {
            return Ok(());
        };
        let header = MessageHeader {
            channel_id: channel.id,
            sequence: channel.messages,
            log_time: piece.log_time,
            publish_time: piece.publish_time,
        };
        channel.messages = channel.messages.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &piece.data)
    }
}
