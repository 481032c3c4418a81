//! MCAP files with JSON messages, for data that are not packets of a channel.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::{MessageHeader, Record};
use mcap::{Compression, WriteOptions, parse_record};

use crate::RecordingError;
use crate::records::each_record;

/// A JSON message.
#[derive(Debug, Clone, PartialEq)]
pub struct JsonMessage {
    /// Kind of the message; viewers show the messages of a topic together.
    pub topic: String,
    /// Time of the recording, in nanoseconds.
    pub time_ns: u64,
    /// A JSON object.
    pub text: String,
}

/// Writes messages into a new file.
///
/// # Errors
/// The file exists or cannot be written.
pub fn write_json_messages(
    path: &Path,
    messages: impl IntoIterator<Item = JsonMessage>,
) -> Result<(), RecordingError> {
    let file = File::create_new(path).map_err(|source| RecordingError::Io {
        path: path.into(),
        source,
    })?;
    let write = || -> mcap::McapResult<()> {
        let mut writer = WriteOptions::new()
            .compression(Some(Compression::Zstd))
            .compression_threads(0)
            .library(concat!("tactnet ", env!("CARGO_PKG_VERSION")))
            .create(BufWriter::new(file))?;
        let mut channels: BTreeMap<String, (u16, u32)> = BTreeMap::new();
        for message in messages {
            let (channel_id, sequence) = match channels.get_mut(&message.topic) {
                Some((id, sequence)) => {
                    *sequence += 1;
                    (*id, *sequence)
                }
                None => {
                    let schema =
                        writer.add_schema(&message.topic, "jsonschema", br#"{"type":"object"}"#)?;
                    let none = BTreeMap::new();
                    let id = writer.add_channel(schema, &message.topic, "json", &none)?;
                    channels.insert(message.topic, (id, 0));
                    (id, 0)
                }
            };
            let header = MessageHeader {
                channel_id,
                sequence,
                log_time: message.time_ns,
                publish_time: message.time_ns,
            };
            writer.write_to_known_channel(&header, message.text.as_bytes())?;
        }
        writer.finish().map(drop)
    };
    write().map_err(|source| RecordingError::Write {
        path: path.into(),
        source,
    })
}

/// Reads the JSON messages of a file in their order, and skips others.
///
/// # Errors
/// The file cannot be read, is not an MCAP file, is damaged, or has no proper end.
pub fn read_json_messages(path: &Path) -> Result<Vec<JsonMessage>, RecordingError> {
    let mut topics: BTreeMap<u16, String> = BTreeMap::new();
    let (mut messages, mut ended) = (Vec::new(), false);
    let cut = each_record(path, |opcode, data| {
        match parse_record(opcode, data).map_err(|error| error.to_string())? {
            Record::Channel(channel) if channel.message_encoding == "json" => {
                topics.insert(channel.id, channel.topic);
            }
            Record::Message { header, data } => {
                let topic = topics.get(&header.channel_id);
                let text = String::from_utf8(data.into_owned()).ok();
                if let (Some(topic), Some(text)) = (topic, text) {
                    messages.push(JsonMessage {
                        topic: topic.clone(),
                        time_ns: header.log_time,
                        text,
                    });
                }
            }
            Record::Footer(_) => ended = true,
            _ => {}
        }
        Ok(())
    })?;
    match cut {
        None if ended => Ok(messages),
        cut => Err(RecordingError::Unreadable {
            path: path.into(),
            reason: cut.unwrap_or_else(|| "the file has no proper end".into()),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages() -> Vec<JsonMessage> {
        let message = |topic: &str, time_ns, text: &str| JsonMessage {
            topic: topic.into(),
            time_ns,
            text: text.into(),
        };
        vec![
            message("b", 3, r#"{"x": 1}"#),
            message("a", 2, r#"{"ü": []}"#),
            message("b", 9, "{}"),
        ]
    }

    #[test]
    fn messages_come_back_in_their_order_and_nothing_is_overwritten() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.mcap");
        write_json_messages(&path, messages()).unwrap();
        assert_eq!(read_json_messages(&path).unwrap(), messages());
        let again = write_json_messages(&path, messages()).unwrap_err();
        assert!(again.to_string().contains("exists"), "{again}");
    }

    #[test]
    fn a_file_that_is_cut_or_none_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.mcap");
        write_json_messages(&path, messages()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for cut in [0, 5, whole.len() / 2, whole.len() - 60] {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert!(read_json_messages(&path).is_err(), "{cut}");
        }
        std::fs::write(&path, "some text of more than a few bytes that is not MCAP").unwrap();
        let refused = read_json_messages(&path).unwrap_err().to_string();
        assert!(refused.contains("not an MCAP file"), "{refused}");
    }
}
