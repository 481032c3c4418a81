//! Recordings of channels: MCAP files (<https://mcap.dev>) with Protocol Buffers messages, as Foxglove and its tools read them.
//!
//! [`Recorder`] writes what travels on the channels, [`Recording`] reads it back as far as it goes, [`sweeps`] makes a data set of it, [`play`] puts it back onto
//! channels.

mod described_channels;
mod error;
mod json_messages;
mod kept_run;
mod lengths;
mod listener;
mod messages;
mod recorder;
mod recording;
mod records;
mod replay;
mod sweeps;
#[cfg(feature = "rerun")]
pub mod view;

pub use error::RecordingError;
pub use json_messages::{JsonMessage, read_json_messages, write_json_messages};
pub use kept_run::{files_of_run, unpack_run};
pub use listener::{Heard, Listener};
pub use messages::{PlainPacket, Recordable};
pub use recorder::{About, Counts, Recorder};
pub use recording::{Entry, RecordedPacket, Recording};
pub use replay::{FrameLosses, Played, ReplayReport, SweepBeliefs, play};
pub use sweeps::{SweepSettings, Sweeps, sweeps};

/// Name of the metadata record with the table of channels.
const METADATA: &str = "tactnet";
/// Its entry with the nanoseconds since 1970 when the channels' clock was zero.
const EPOCH: &str = "channel_clock_zero_ns";
