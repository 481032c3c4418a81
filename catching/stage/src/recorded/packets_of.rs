//! Packets of one type in a recording.

use tactnet_channel::Packet;
use tactnet_recording::{RecordedPacket, Recording};

use super::RecordedError;

/// A packet and its publication time, in ns of the channels' clock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Put<T> {
    pub ns: u64,
    pub packet: T,
}

/// Returns the packets of a type on all channels, or on one, in the order of publication.
pub(crate) fn packets_of<T: Packet>(
    recording: &Recording,
    channel: Option<&str>,
) -> Result<Vec<Put<T>>, RecordedError> {
    let zero = recording
        .channel_clock_zero_ns
        .ok_or(RecordedError::NoClock)?;
    let entries = recording.entries.iter();
    Ok(entries
        .filter(|entry| channel.is_none_or(|channel| *entry.channel == *channel))
        .filter_map(|entry| match &entry.packet {
            RecordedPacket::Plain(packet) => Some(Put {
                ns: entry.time_ns.saturating_sub(zero),
                packet: packet.get()?,
            }),
            _ => None,
        })
        .collect())
}
