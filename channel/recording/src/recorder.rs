//! Recorder of channels: one thread follows the channels, one compresses and writes.
//!
//! ```text
//! channels whose packets are described ──> Recorder::step ── at most 8192 messages wait ──> writer ──> FILE.mcap
//! ```
//!
//! If the disk is too slow for long, the rings of the channels keep the newest packets and count lost ones.

use std::path::Path;
use std::time::Duration;

use tactnet_channel::{Bus, Packet, Table, now_ns};
use tactnet_skin::packets::{SkinFrame, TactileBelief};

use crate::RecordingError;
use crate::channel_file::{ChannelFile, Piece};
use crate::described_channels::DescribedChannels;
use crate::messages::Kind;

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

impl Counts {
    /// Counts a message.
    pub(crate) fn add(&mut self, kind: &Kind) {
        self.messages += 1;
        match kind.layout.name {
            SkinFrame::NAME => self.frames += 1,
            TactileBelief::NAME => self.beliefs += 1,
            _ => {}
        }
    }
}

/// Writes the packets of all described channels of a table to a file.
pub struct Recorder {
    followed: DescribedChannels,
    file: ChannelFile,
    /// Start of the recording, in nanoseconds since 1970.
    begun_ns: u64,
    counts: Counts,
}

impl Recorder {
    /// Opens the channels and creates the file, which contains the whole table of the bus.
    ///
    /// - `table`: all channels of the bus, or those of [`select_channels`](crate::select_channels)
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
        let begun_ns = followed.epoch_ns + now_ns();
        let file = ChannelFile::create(path, bus.table(), about, &followed, begun_ns)?;
        let counts = Counts {
            channels: followed.channels().len(),
            ..Counts::default()
        };
        Ok(Self {
            followed,
            file,
            begun_ns,
            counts,
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
        let mut is_writing = true;
        let followed = self.followed.channels();
        self.followed.follow(|item| {
            let kind = followed[item.place].kind;
            self.counts.add(kind);
            is_writing &= self.file.send(Piece {
                place: item.place,
                sender: item.sender,
                // Packets from the history must not extend the recording to the past.
                log_time: item.put_ns.max(self.begun_ns),
                publish_time: item.put_ns,
                data: kind.to_message(item.bytes),
            });
        })?;
        if is_writing { Ok(()) } else { self.file.end() }
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
        self.file.end()?;
        Ok(self.counts())
    }
}

#[cfg(test)]
mod tests {
    use tactnet_channel::{ChannelConfig, ChannelId, Description, Domain, Priority};

    use super::*;
    use crate::{RecordedPacket, Recording, add_packet_types};

    #[test]
    fn packets_of_a_description_file_are_recorded_and_read() {
        let file = "/../packet/tests/own_packets/arm.toml";
        let file = format!("{}{file}", env!("CARGO_MANIFEST_DIR"));
        let arm = Description::read(Path::new(&file)).unwrap();
        add_packet_types(&arm);
        let bytes = arm.packets.last().unwrap().bytes;
        let config = ChannelConfig {
            packet: "ArmState".into(),
            version: 2,
            item_bytes: bytes,
            ..ChannelConfig::of::<u8>(1)
        };
        let table = Table::new("own").with("arm", config);
        let bus = Bus::open(Domain::Process, &table).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("own.mcap");
        let mut recorder = Recorder::start(&bus, &table, &path, &About::default()).unwrap();
        let id = ChannelId::new("arm").unwrap();
        let put = bus.raw_put_port(id, Priority::Normal).unwrap();
        let mut packet = vec![0; bytes];
        // The time, and one of two valid contacts.
        packet[..8].copy_from_slice(&7_u64.to_le_bytes());
        packet[12] = 1;
        put.put_copy(&packet).unwrap();
        recorder.step(Duration::from_secs(5)).unwrap();
        assert_eq!(recorder.finish().unwrap().messages, 1);
        let recording = Recording::read(&path).unwrap();
        let [entry] = &recording.entries[..] else {
            panic!("{recording:?}");
        };
        let RecordedPacket::Plain(packet) = &entry.packet else {
            panic!("{entry:?}");
        };
        let value = serde_json::to_value(packet).unwrap();
        assert_eq!(
            (&value["type"], &value["time_ns"]),
            (&"ArmState".into(), &7.into())
        );
        assert_eq!(value["contact_points"].as_array().unwrap().len(), 1);
        assert_eq!(value["joints"].as_array().unwrap().len(), 3);
    }
}
