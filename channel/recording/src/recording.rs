//! A recording read back, as far as it goes.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

use mcap::parse_record;
use mcap::records::Record;
use tactnet_channel::Table;
use tactnet_skin::packets::{ModelNames, SkinFrame, SweepCommand, TactileBelief, TactileStatus};

use crate::messages::{PlainPacket, Recordable, kind_of_message};
use crate::records::each_record;
use crate::{EPOCH, METADATA, RecordingError};

/// One packet of a recording.
#[derive(Debug, Clone)]
pub struct Entry {
    /// Id of its channel.
    pub channel: Arc<str>,
    /// When it was put, nanoseconds since 1970; not before the recording began.
    pub time_ns: u64,
    /// The packet.
    pub packet: RecordedPacket,
}

/// The packets that a recording may hold.
#[derive(Debug, Clone)]
pub enum RecordedPacket {
    /// Of a finger's skin.
    Frame(Box<SkinFrame>),
    /// Of the motion controller or a person.
    Command(SweepCommand),
    /// Of the classifier.
    Belief(Box<TactileBelief>),
    /// Of the classifier.
    Status(Box<TactileStatus>),
    /// Of the classifier.
    Model(Box<ModelNames>),
    /// Any other, of the catching stack for example.
    Plain(PlainPacket),
}

/// The contents of a file, in memory: about 0.5 GB for an hour of one finger at 750 Hz.
#[derive(Debug, Clone)]
pub struct Recording {
    /// In the order of the times at which they were put.
    pub entries: Vec<Entry>,
    /// The table of channels.
    pub table: Table,
    /// When the channels' clock was zero, nanoseconds since 1970; `None` in recordings that do not tell.
    pub channel_clock_zero_ns: Option<u64>,
    /// The material that was swept over, where it was one material only.
    pub material: Option<String>,
    /// Files that were kept with it.
    pub files: BTreeMap<String, Vec<u8>>,
    /// Why the rest is missing, if it is: the recorder was killed, the disk was full, the file was damaged.
    pub cut: Option<String>,
    /// Messages that are none of ours, or more than a packet can hold; they are left out.
    pub foreign: usize,
}

/// The contents read so far.
#[derive(Default)]
struct Found {
    entries: Vec<Entry>,
    table: Option<Table>,
    channel_clock_zero_ns: Option<u64>,
    material: Option<String>,
    files: BTreeMap<String, Vec<u8>>,
    foreign: usize,
    ended: bool,
    /// Names by id.
    schemas: HashMap<u16, String>,
    /// Topic and schema by id.
    channels: HashMap<u16, (Arc<str>, u16)>,
}

impl Recording {
    /// Reads a file, wherever it ends. A chunk whose checksum is wrong ends it, too.
    ///
    /// # Errors
    /// No MCAP file; one without the table of channels.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let unreadable = |reason: String| RecordingError::Unreadable {
            path: path.into(),
            reason,
        };
        let mut found = Found::default();
        let mut cut = each_record(path, |opcode, data| found.take(opcode, data))?;
        if !found.ended && cut.is_none() {
            cut = Some("it was not ended properly".into());
        }
        let table = found.table.ok_or_else(|| {
            let why = cut.as_deref().unwrap_or("no table of channels in it");
            unreadable(format!("no recording of `tactnet record`: {why}"))
        })?;
        // Channels are looked at in turns while they are recorded.
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

impl Found {
    /// Takes one record; gives why nothing behind it can be trusted.
    fn take(&mut self, opcode: u8, data: &[u8]) -> Result<(), String> {
        match parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let of = (channel.topic.into(), channel.schema_id);
                self.channels.insert(channel.id, of);
            }
            Record::Message { header, data } => {
                let known = self.channels.get(&header.channel_id);
                let packet = known.and_then(|(channel, schema)| {
                    let packet = decoded(self.schemas.get(schema)?, &data)?;
                    Some((channel.clone(), packet))
                });
                match packet {
                    Some((channel, packet)) => self.entries.push(Entry {
                        channel,
                        time_ns: header.log_time,
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
            Record::Footer(_) => self.ended = true,
            // Other programs' own records have larger numbers.
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
