//! Topics of MCAP files of any program: numbers in messages of ROS 2, ROS 1, Protocol Buffers and JSON.
//!
//! [`topics`] lists them, and [`topic_frames`] returns the numbers of one as frames of a data set.

mod protobuf;
mod ros;
mod ros_definition;
mod value;

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use mcap::parse_record;
use mcap::records::Record;
use prost_reflect::MessageDescriptor;
use tactnet_data::format::FrameSeries;

use crate::RecordingError;
use crate::records::each_record;
use ros_definition::Definitions;
use value::Value;

/// A topic of an MCAP file.
#[derive(Debug, Clone)]
pub struct Topic {
    /// Name of the topic.
    pub name: String,
    /// Type of its messages; empty for JSON without a schema.
    pub message_type: String,
    /// Encoding of its messages: `cdr`, `ros1`, `protobuf`, `json`, or another that is not read.
    pub encoding: String,
    /// Number of messages.
    pub messages: usize,
    /// Paths and lengths of the numbers in its first message, or the reason why it cannot be read.
    pub numbers: Result<Vec<(String, usize)>, String>,
}

/// Topics of a file.
#[derive(Debug, Clone)]
pub struct Topics {
    /// Topics by name.
    pub topics: Vec<Topic>,
    /// Reason why the end is missing, if it is.
    pub cut: Option<String>,
}

/// Selection of the frames of a topic.
#[derive(Debug, Clone, Default)]
pub struct TopicSelection {
    /// Name of the topic.
    pub topic: String,
    /// Paths of the numbers in a message, such as `wrench.force` or `layers[0].values`; empty: the only array of numbers.
    pub fields: Vec<String>,
    /// Path of the label in a message.
    pub label: Option<String>,
}

/// Frames of a topic, one a message.
#[derive(Debug)]
pub struct TopicFrames {
    /// Times, values and labels.
    pub series: FrameSeries,
    /// Paths of the numbers.
    pub fields: Vec<String>,
    /// Origin of the times.
    pub clock: TopicClock,
    /// Reason why the end is missing, if it is.
    pub cut: Option<String>,
}

/// Origin of the times of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TopicClock {
    /// Stamps in the messages, such as `header.stamp`.
    Stamps,
    /// Times at which the messages were recorded.
    Recorder,
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` (", self.name)?;
        if !self.message_type.is_empty() {
            write!(f, "{}, ", self.message_type)?;
        }
        write!(f, "{}, {} messages): ", self.encoding, self.messages)?;
        match &self.numbers {
            Err(reason) => f.write_str(reason),
            Ok(paths) if paths.is_empty() => f.write_str("no numbers"),
            Ok(paths) => f.write_str(&shown(paths)),
        }
    }
}

/// Returns the paths with their lengths, arrays first.
fn shown(paths: &[(String, usize)]) -> String {
    const SHOWN: usize = 8;
    let mut paths: Vec<&(String, usize)> = paths.iter().collect();
    paths.sort_by_key(|(_, count)| *count < 2);
    let hidden = paths.len().saturating_sub(SHOWN);
    let of = |(path, count): &&(String, usize)| match count {
        1 => path.clone(),
        count => format!("{path} [{count}]"),
    };
    let mut text = paths
        .iter()
        .take(SHOWN)
        .map(of)
        .collect::<Vec<_>>()
        .join(", ");
    if hidden > 0 {
        text.push_str(&format!(" and {hidden} more"));
    }
    text
}

/// Lists the topics of an MCAP file.
///
/// # Errors
/// A file that cannot be read, or is not an MCAP file.
pub fn topics(path: &Path) -> Result<Topics, RecordingError> {
    let mut found: Vec<Topic> = Vec::new();
    let mut decoders = Decoders::default();
    let cut = each_record(path, |opcode, data| {
        let Some((channel, message)) = decoders.take(opcode, data)? else {
            return Ok(());
        };
        if let Some(topic) = found.iter_mut().find(|topic| topic.name == channel.topic) {
            topic.messages += 1;
            return Ok(());
        }
        found.push(Topic {
            name: channel.topic.clone(),
            message_type: channel.message_type.clone(),
            encoding: channel.encoding.clone(),
            messages: 1,
            numbers: channel
                .decode(&message.data)
                .map(|message| message.numeric_paths()),
        });
        Ok(())
    })?;
    found.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(Topics { topics: found, cut })
}

/// Returns the numbers of a topic as frames.
///
/// # Errors
/// A topic or path that the file does not have; messages that cannot be decoded or have several numbers of values.
pub fn topic_frames(
    path: &Path,
    selection: &TopicSelection,
) -> Result<TopicFrames, RecordingError> {
    let mut frames = Frames::new(selection);
    let mut decoders = Decoders::default();
    let mut refused = None;
    let cut = each_record(path, |opcode, data| {
        if refused.is_some() {
            return Ok(());
        }
        match decoders.take(opcode, data)? {
            Some((channel, message)) if channel.topic == selection.topic => {
                refused = frames.add(channel, &message).err();
            }
            _ => {}
        }
        Ok(())
    })?;
    let unreadable = |reason| RecordingError::Unreadable {
        path: path.into(),
        reason,
    };
    if let Some(reason) = refused {
        return Err(unreadable(format!("topic `{}`, {reason}", selection.topic)));
    }
    if frames.recorded_ns.is_empty() {
        let topics = topics(path)?.topics;
        if let Some(cut) = cut.filter(|_| topics.is_empty()) {
            return Err(unreadable(cut));
        }
        return Err(RecordingError::NoTopic {
            path: path.into(),
            topic: selection.topic.clone(),
            topics,
        });
    }
    Ok(frames.finish(cut))
}

/// Frames of a topic read so far.
struct Frames<'a> {
    selection: &'a TopicSelection,
    fields: Vec<String>,
    names: Vec<String>,
    values: Vec<f64>,
    labels: Vec<String>,
    recorded_ns: Vec<u64>,
    stamps_ns: Vec<Option<i64>>,
}

impl<'a> Frames<'a> {
    fn new(selection: &'a TopicSelection) -> Self {
        Self {
            selection,
            fields: selection.fields.clone(),
            names: Vec::new(),
            values: Vec::new(),
            labels: Vec::new(),
            recorded_ns: Vec::new(),
            stamps_ns: Vec::new(),
        }
    }

    /// Adds the frame of a message.
    ///
    /// # Errors
    /// A message that cannot be decoded, has another number of values than the first, or no such field.
    fn add(&mut self, channel: &Channel, message: &Message) -> Result<(), String> {
        let number = self.recorded_ns.len();
        let decoded = channel.decode(&message.data);
        let decoded = decoded.map_err(|reason| format!("message {number}: {reason}"))?;
        if self.fields.is_empty() {
            self.fields = vec![only_array(&decoded)?];
        }
        let before = self.values.len();
        let mut names = Vec::new();
        for field in &self.fields {
            let numbers = decoded
                .numbers(field)
                .filter(|numbers| !numbers.is_empty() || number > 0);
            let numbers = numbers.ok_or_else(|| missing(&decoded, field, "no numbers"))?;
            if number == 0 {
                names.extend(names_of(field, numbers.len()));
            }
            self.values.extend(numbers);
        }
        let count = self.values.len() - before;
        if number == 0 {
            self.names = names;
        } else if count != self.names.len() {
            return Err(format!(
                "message {number}: {count} numbers, the first message has {}",
                self.names.len()
            ));
        }
        if let Some(path) = &self.selection.label {
            let label = decoded.label(path);
            self.labels
                .push(label.ok_or_else(|| missing(&decoded, path, "no text or number"))?);
        }
        self.recorded_ns.push(message.log_time_ns);
        self.stamps_ns.push(decoded.stamp_ns());
        Ok(())
    }

    fn finish(self, cut: Option<String>) -> TopicFrames {
        // Programs that do not set the stamp leave it at zero.
        let stamps: Option<Vec<i64>> = self.stamps_ns.into_iter().collect();
        let stamps = stamps.filter(|stamps| {
            stamps.first() != stamps.last() || stamps.len() == 1 && stamps[0] != 0
        });
        let (times_ns, clock) = match stamps {
            Some(stamps) => (stamps, TopicClock::Stamps),
            None => {
                let recorded = self.recorded_ns.iter();
                (
                    recorded
                        .map(|ns| i64::try_from(*ns).unwrap_or(i64::MAX))
                        .collect(),
                    TopicClock::Recorder,
                )
            }
        };
        TopicFrames {
            series: FrameSeries {
                seconds: times_ns.iter().map(|ns| *ns as f64 / 1e9).collect(),
                taxels: self.names,
                values: self.values,
                labels: self.selection.label.is_some().then_some(self.labels),
            },
            fields: self.fields,
            clock,
            cut,
        }
    }
}

/// Returns the names of the taxels of a field.
fn names_of(field: &str, count: usize) -> Vec<String> {
    match count {
        1 => vec![field.to_owned()],
        count => (0..count)
            .map(|taxel| format!("{field}[{taxel}]"))
            .collect(),
    }
}

/// Returns the path of the only array of numbers in a message.
///
/// # Errors
/// No or several arrays.
fn only_array(message: &Value) -> Result<String, String> {
    let paths = message.numeric_paths();
    let mut arrays = paths.iter().filter(|(_, count)| *count > 1);
    match (arrays.next(), arrays.next()) {
        (Some((path, _)), None) => Ok(path.clone()),
        _ => Err(format!(
            "several fields have numbers, name one or more of {}",
            shown(&paths)
        )),
    }
}

fn missing(message: &Value, field: &str, what: &str) -> String {
    format!(
        "field `{field}`: {what} there; fields with numbers: {}",
        shown(&message.numeric_paths())
    )
}

/// Type and encoding of the messages of a channel.
#[derive(Debug)]
struct Channel {
    topic: String,
    message_type: String,
    encoding: String,
    decoder: Result<Decoder, String>,
}

#[derive(Debug)]
enum Decoder {
    Json,
    Ros(ros::Encoding, Definitions),
    Protobuf(MessageDescriptor),
}

impl Channel {
    fn decode(&self, data: &[u8]) -> Result<Value, String> {
        match self.decoder.as_ref().map_err(Clone::clone)? {
            Decoder::Json => {
                let json: serde_json::Value =
                    serde_json::from_slice(data).map_err(|error| error.to_string())?;
                Ok(json.into())
            }
            Decoder::Ros(encoding, definitions) => ros::decode(definitions, *encoding, data),
            Decoder::Protobuf(descriptor) => protobuf::decode(descriptor, data),
        }
    }
}

/// A message of a recording.
struct Message {
    data: Vec<u8>,
    log_time_ns: u64,
}

/// Type of messages that the recording describes.
struct Schema {
    name: String,
    encoding: String,
    data: Vec<u8>,
}

/// Types and channels read so far.
#[derive(Default)]
struct Decoders {
    schemas: HashMap<u16, Schema>,
    channels: HashMap<u16, Channel>,
}

impl Decoders {
    /// Reads one record. Returns a message with its channel.
    ///
    /// # Errors
    /// A record that cannot be read: the rest of the file is damaged.
    fn take(&mut self, opcode: u8, data: &[u8]) -> Result<Option<(&Channel, Message)>, String> {
        match parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Schema { header, data } => {
                let schema = Schema {
                    name: header.name,
                    encoding: header.encoding,
                    data: data.into_owned(),
                };
                self.schemas.insert(header.id, schema);
            }
            Record::Channel(channel) => {
                let schema = self.schemas.get(&channel.schema_id);
                let decoder = decoder(&channel.message_encoding, schema);
                let channel_id = channel.id;
                let channel = Channel {
                    topic: channel.topic,
                    message_type: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
                    encoding: channel.message_encoding,
                    decoder,
                };
                self.channels.insert(channel_id, channel);
            }
            Record::Message { header, data } => {
                let message = Message {
                    data: data.into_owned(),
                    log_time_ns: header.log_time,
                };
                return Ok(self
                    .channels
                    .get(&header.channel_id)
                    .map(|of| (of, message)));
            }
            _ => {}
        }
        Ok(None)
    }
}

/// Returns the decoder of a channel, or the reason why there is none.
fn decoder(encoding: &str, schema: Option<&Schema>) -> Result<Decoder, String> {
    let described =
        || schema.ok_or_else(|| format!("{encoding} without a description of its type"));
    let definitions = || {
        let schema = described()?;
        if !["ros2msg", "ros1msg"].contains(&&*schema.encoding) {
            return Err(format!(
                "types described as `{}` are not read; ros2msg is",
                schema.encoding
            ));
        }
        Definitions::parse(&schema.name, &String::from_utf8_lossy(&schema.data))
    };
    match encoding {
        "json" => Ok(Decoder::Json),
        "cdr" => Ok(Decoder::Ros(ros::Encoding::Cdr, definitions()?)),
        "ros1" => Ok(Decoder::Ros(ros::Encoding::Ros1, definitions()?)),
        "protobuf" => {
            let schema = described()?;
            Ok(Decoder::Protobuf(protobuf::descriptor(
                &schema.name,
                &schema.data,
            )?))
        }
        other => Err(format!(
            "messages encoded as `{other}` are not read; cdr, ros1, protobuf and json are"
        )),
    }
}
