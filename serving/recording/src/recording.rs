//! A recording read back, as far as it goes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::read::LinearReader;
use mcap::read::{MessageStream, Options};
use mcap::records::Record;
use tactnet_channel::Table;
use tactnet_serving::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};

use crate::messages::Recordable;
use crate::{METADATA, RecordingError};

/// One packet of a recording.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Id of its channel.
    pub channel: String,
    /// When it was put, nanoseconds since 1970.
    pub time_ns: u64,
    /// The packet.
    pub packet: RecordedPacket,
}

/// The packets that a recording may hold.
#[derive(Debug, Clone)]
pub enum RecordedPacket {
    /// Of a finger's skin.
    Frame(SkinFrame),
    /// Of the motion controller or a person.
    Command(SweepCommand),
    /// Of the classifier.
    Belief(Box<TactileBelief>),
    /// Of the classifier.
    Status(Box<TactileStatus>),
    /// Of the classifier.
    Model(Box<ModelNames>),
}

/// What a file holds.
#[derive(Debug, Clone)]
pub struct Recording {
    /// In the order of the times at which they were put.
    pub entries: Vec<Entry>,
    /// The table of channels.
    pub table: Table,
    /// What was swept over, where it was one material only.
    pub material: Option<String>,
    /// Files that were kept with it.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Why the end is missing, if it is: the recorder was killed, or the disk was full.
    pub cut: Option<String>,
    /// Messages of other programs, which are left out.
    pub foreign: usize,
}

impl Recording {
    /// Reads a file, wherever it ends.
    ///
    /// # Errors
    /// No MCAP file; one without the table of channels.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let bytes = std::fs::read(path).map_err(|source| RecordingError::Io {
            path: path.into(),
            source,
        })?;
        let unreadable = |reason: String| RecordingError::Unreadable {
            path: PathBuf::from(path),
            reason,
        };
        if !bytes.starts_with(mcap::MAGIC) {
            return Err(unreadable("not an MCAP file".into()));
        }
        let mut table = None;
        let mut material = None;
        let mut files = BTreeMap::new();
        let mut ended = false;
        let whole = |error: &mcap::McapError| unreadable(format!("cannot read it: {error}"));
        let records = LinearReader::new_with_options(&bytes, Options::IgnoreEndMagic.into())
            .map_err(|error| whole(&error))?;
        // Where the rest is missing is found again below.
        for record in records.map_while(Result::ok) {
            match record {
                Record::Metadata(found) if found.name == METADATA => {
                    material = found.metadata.get("material").cloned();
                    let text = found.metadata.get("table").map_or("", String::as_str);
                    table = Some(toml::from_str::<Table>(text).map_err(|error| {
                        unreadable(format!("its table of channels: {}", error.message()))
                    })?);
                }
                Record::Attachment { header, data, .. } => {
                    files.insert(header.name, data.into_owned());
                }
                Record::Footer(_) => ended = true,
                _ => {}
            }
        }
        let table = table.ok_or_else(|| {
            unreadable("no recording of `tactnet record`: no table of channels".into())
        })?;
        let mut entries: Vec<Entry> = Vec::new();
        let mut cut = None;
        let mut foreign = 0;
        let messages = MessageStream::new_with_options(&bytes, Options::IgnoreEndMagic.into())
            .map_err(|error| whole(&error))?;
        for message in messages {
            match message {
                Ok(message) => {
                    let name = message
                        .channel
                        .schema
                        .as_ref()
                        .map_or("", |s| s.name.as_str());
                    match decoded(name, &message.data) {
                        Some(packet) => entries.push(Entry {
                            channel: message.channel.topic.clone(),
                            time_ns: message.log_time,
                            packet,
                        }),
                        None => foreign += 1,
                    }
                }
                Err(error) => {
                    cut = Some(error.to_string());
                    break;
                }
            }
        }
        if !ended && cut.is_none() {
            cut = Some("it was not ended properly".into());
        }
        // Channels are looked at in turns while they are recorded.
        entries.sort_by_key(|entry| entry.time_ns);
        Ok(Self {
            entries,
            table,
            material,
            files,
            cut,
            foreign,
        })
    }
}

fn decoded(name: &str, data: &[u8]) -> Option<RecordedPacket> {
    Some(match name {
        SkinFrame::MESSAGE => RecordedPacket::Frame(SkinFrame::from_message(data)?),
        SweepCommand::MESSAGE => RecordedPacket::Command(SweepCommand::from_message(data)?),
        TactileBelief::MESSAGE => RecordedPacket::Belief(TactileBelief::from_message(data)?.into()),
        TactileStatus::MESSAGE => RecordedPacket::Status(TactileStatus::from_message(data)?.into()),
        ModelNames::MESSAGE => RecordedPacket::Model(ModelNames::from_message(data)?.into()),
        _ => return None,
    })
}
