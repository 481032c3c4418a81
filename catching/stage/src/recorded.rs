//! Analysis of recordings of the catching stack, on a robot or in the simulated world.
//!
//! ```text
//! recording ─┬─> timing  from every exposure to its path, step by step, from the timestamps in the packets
//!             └─> replay  packets through tracker, coordinator and planners; compares the results
//! ```

mod chain;
mod decisions;
mod picture;
mod replay;
mod session;
mod timing;

pub use replay::{Compared, Replayed, replay};
pub use session::{read_session, write_session};
pub use timing::{Step, Timing, timing};

use tactnet_channel::Packet;
use tactnet_recording::{RecordedPacket, Recording};

/// Error of the analysis of a recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// The recording has no paths.
    #[error("expected a recording of the catching stack, found no packets of it")]
    NotCatching,
    /// Times of channels and times in packets are not comparable.
    #[error(
        "the recording lacks the start of the channels' clock, so times in packets are not comparable with it"
    )]
    NoClock,
    /// Invalid settings of the stack in the table of the recording.
    #[error("the recording's table: {0}")]
    Settings(#[from] tactnet_catching_roles::RoleError),
}

/// A packet and its publication time, in ns of the channels' clock.
#[derive(Debug, Clone, Copy)]
struct Put<T> {
    ns: u64,
    packet: T,
}

/// Returns the packets of a type on all channels, or on one, in the order of publication.
fn packets_of<T: Packet>(
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
