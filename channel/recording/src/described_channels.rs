//! All channels of a table whose packets have a description, followed by one thread.

use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tactnet_channel::{Bus, GetPort, GetSide, PacketType, Start, SyncGroup, Table, Wait, now_ns};

use crate::RecordingError;
use crate::messages::{Kind, kind};

/// Maximum number of packets taken from a channel before the next channel has its turn.
const MAX_PACKETS: usize = 256;

/// A channel with its port.
pub(crate) struct Channel {
    pub id: Arc<str>,
    pub kind: &'static Kind,
    port: GetPort<u8>,
}

/// An item of a received packet.
pub(crate) struct ReceivedItem<'a> {
    /// Index of its channel.
    pub place: usize,
    /// Time of the put, in nanoseconds since 1970.
    pub put_ns: u64,
    /// Random number of the put-port.
    pub sender: u64,
    pub bytes: &'a [u8],
}

/// Follows channels. If the caller is too slow, the rings keep the newest packets and count lost ones.
pub(crate) struct DescribedChannels {
    group: SyncGroup,
    channels: Vec<Channel>,
    /// Zero of the channels' clock, in nanoseconds since 1970.
    pub epoch_ns: u64,
}

impl DescribedChannels {
    /// Opens the channels. Images are skipped: they are bytes without a description.
    ///
    /// # Errors
    /// No hub runs; no channel has packets with a description.
    pub fn open(bus: &Bus, table: &Table) -> Result<Self, RecordingError> {
        let mut channels = Vec::new();
        for (id, config) in &table.channels {
            let Some(kind) = kind(&config.packet, config.version) else {
                continue;
            };
            let packet = PacketType {
                name: kind.layout.name,
                version: kind.layout.version,
                item_bytes: kind.layout.bytes,
            };
            let start = if kind.is_needed_to_read_others() {
                Start::History(1)
            } else {
                Start::Now
            };
            channels.push(Channel {
                id: id.as_str().into(),
                kind,
                port: bus.get_port_of(id.as_str(), packet, start)?,
            });
        }
        if channels.is_empty() {
            return Err(RecordingError::NothingDescribed);
        }
        let sides: Vec<&dyn GetSide> = channels.iter().map(|of| &of.port as &dyn GetSide).collect();
        let group = bus.sync_group(&sides)?;
        let since = SystemTime::now().duration_since(UNIX_EPOCH);
        let since_ns = since.map_or(0, |since| since.as_nanos() as u64);
        Ok(Self {
            group,
            channels,
            epoch_ns: since_ns.saturating_sub(now_ns()),
        })
    }

    /// Returns the channels, ordered by id.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// Waits for packets, at most for `patience`.
    pub fn wait(&mut self, patience: Duration) -> Result<(), RecordingError> {
        let wait = Wait::Block { timeout: patience };
        Ok(self.group.wait(wait).map(drop)?)
    }

    /// Passes on the items of received packets.
    ///
    /// Takes a limited number of packets from each channel, so that no channel waits long for the others.
    pub fn follow(&self, mut each: impl FnMut(ReceivedItem<'_>)) -> Result<(), RecordingError> {
        for (place, channel) in self.channels.iter().enumerate() {
            for _ in 0..MAX_PACKETS {
                let Some(packets) = channel.port.try_get()? else {
                    break;
                };
                let header = *packets.header();
                // The clock of another host has another zero.
                let put_ns = if header.remote == 0 {
                    header.put_ns
                } else {
                    now_ns()
                };
                for bytes in packets.chunks_exact(channel.kind.layout.bytes) {
                    each(ReceivedItem {
                        place,
                        put_ns: self.epoch_ns + put_ns,
                        sender: header.sender,
                        bytes,
                    });
                }
            }
        }
        Ok(())
    }

    /// Returns the number of packets that were put and never arrived.
    pub fn lost(&self) -> u64 {
        self.channels
            .iter()
            .map(|channel| channel.port.lost())
            .sum()
    }
}
