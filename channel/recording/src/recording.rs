//! Reader of recordings, including incomplete ones.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

use mcap::parse_record;
use mcap::records::Record;
use tactnet_channel::Table;
use tactnet_skin::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};

use crate::messages::{PlainPacket, Recordable, kind_of_message};
use crate::records::each_record;
use crate::topics::{Topics, topics};
use crate::{EPOCH, METADATA, RecordingError, SENDER};

/// One packet of a recording.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Id of its channel.
    pub channel: Arc<str>,
    /// Time of the put, in nanoseconds since 1970; not before the start of the recording.
    pub time_ns: u64,
    /// Random number of the put-port; `None` in old recordings.
    pub sender: Option<u64>,
    /// The packet.
    pub packet: RecordedPacket,
}

/// Packets of a recording.
#[derive(Debug, Clone)]
pub enum RecordedPacket {
    /// Frame of a finger's skin.
    Frame(Box<SkinFrame>),
    /// Command of the motion controller or a user.
    Command(SweepCommand),
    /// Belief of the classifier.
    Belief(Box<TactileBelief>),
    /// Status of the classifier.
    Status(Box<TactileStatus>),
    /// Names of the classifier's materials.
    Model(Box<ModelNames>),
    /// Any other packet, for example of the catching stack.
    Plain(PlainPacket),
}

/// Content of a recording in memory: about 0.5 GB for an hour of one finger at 750 Hz.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Packets, ordered by the time of their put.
    pub entries: Vec<Entry>,
    /// Table of channels.
    pub table: Table,
    /// Zero of the channels' clock, in nanoseconds since 1970; `None` in old recordings.
    pub channel_clock_zero_ns: Option<u64>,
    /// Material under the fingers, if it was the same all the time.
    pub material: Option<String>,
    /// Kept files by name.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Reason why the end is missing, if it is: a killed recorder, a full disk, a damaged file.
    pub cut: Option<String>,
    /// Number of skipped messages: of an unknown type, or too long for their packet.
    pub foreign: usize,
}

/// Content read so far.
#[derive(Default)]
struct Contents {
    entries: Vec<Entry>,
    table: Option<Table>,
    channel_clock_zero_ns: Option<u64>,
    material: Option<String>,
    files: BTreeMap<String, Vec<u8>>,
    foreign: usize,
    /// Names of message types by id.
    schemas: HashMap<u16, String>,
    /// Channels by their number in the file.
    channels: HashMap<u16, FileChannel>,
}

/// A channel of the file.
struct FileChannel {
    id: Arc<str>,
    /// Number of its message type.
    schema: u16,
    sender: Option<u64>,
}

impl Recording {
    /// Reads a file up to its end or the first chunk with a wrong checksum.
    ///
    /// # Errors
    /// The file is not an MCAP file, or has no table of channels.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut found = Contents::default();
        let cut = each_record(path, |opcode, data| found.take(opcode, data))?;
        let Some(table) = found.table else {
            let Topics { topics, cut } = topics(path)?;
            return Err(match cut {
                Some(cut) if topics.is_empty() => RecordingError::Unreadable {
                    path: path.into(),
                    reason: format!("not a recording of channels: {cut}"),
                },
                _ => RecordingError::Foreign {
                    path: path.into(),
                    topics,
                },
            });
        };
        // The recorder writes channel by channel.
        found.entries.sort_by_key(|entry| entry.time_ns);
        Ok(Self {
            entries: found.entries,
            table,
            channel_clock_zero_ns: found.channel_clock_zero_ns,
            material: found.material,
            files: found.files,
            cut,
            foreign: found.foreign,
        })
    }
}

impl Contents {
    /// Reads one record. Returns the reason if the rest of the file is unreadable.
    fn take(&mut self, opcode: u8, data: &[u8]) -> Result<(), String> {
        match parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let sender = channel.metadata.get(SENDER);
                let of = FileChannel {
                    id: channel.topic.into(),
                    schema: channel.schema_id,
                    sender: sender.and_then(|number| u64::from_str_radix(number, 16).ok()),
                };
                self.channels.insert(channel.id, of);
            }
            Record::Message { header, data } => {
                let known = self.channels.get(&header.channel_id);
                let packet = known.and_then(|channel| {
                    let packet = decoded(self.schemas.get(&channel.schema)?, &data)?;
                    Some((channel, packet))
                });
                match packet {
                    Some((channel, packet)) => self.entries.push(Entry {
                        channel: channel.id.clone(),
                        time_ns: header.log_time,
                        sender: channel.sender,
                        packet,
                    }),
                    None => self.foreign += 1,
                }
            }
            Record::Metadata(found) if found.name == METADATA => {
                self.material = found.metadata.get("material").cloned();
                let epoch = found.metadata.get(EPOCH);
                self.channel_clock_zero_ns = epoch.and_then(|ns| ns.parse().ok());
                let text = found.metadata.get("table").map_or("", String::as_str);
                let table = toml::from_str(text);
                self.table = Some(table.map_err(|error: toml::de::Error| {
                    format!("its table of channels: {}", error.message())
                })?);
            }
            Record::Attachment { header, data, .. } => {
                self.files.insert(header.name, data.into_owned());
            }
            // Records of other programs have larger numbers.
            Record::Unknown { opcode, .. } if opcode < 0x80 => {
                return Err(format!("a record of unknown kind {opcode:#04x}"));
            }
            _ => {}
        }
        Ok(())
    }
}

fn decoded(name: &str, data: &[u8]) -> Option<RecordedPacket> {
    Some(match name {
        SkinFrame::MESSAGE => RecordedPacket::Frame(SkinFrame::from_message(data)?.into()),
        SweepCommand::MESSAGE => RecordedPacket::Command(SweepCommand::from_message(data)?),
        TactileBelief::MESSAGE => RecordedPacket::Belief(TactileBelief::from_message(data)?.into()),
        TactileStatus::MESSAGE => RecordedPacket::Status(TactileStatus::from_message(data)?.into()),
        ModelNames::MESSAGE => RecordedPacket::Model(ModelNames::from_message(data)?.into()),
        other => RecordedPacket::Plain(PlainPacket::from_message(kind_of_message(other)?, data)?),
    })
}
