//! Recordings of channels: MCAP files (<https://mcap.dev>) with Protocol Buffers messages, which Foxglove and its
//! tools can read.
//!
//! [`Recorder`] writes the packets of all channels to a file, [`MemoryRecorder`] those of the last seconds before a
//! trigger, and [`Recording`] reads them back. [`sweeps`] turns a
//! recording into a data set, and [`play`] puts its packets onto channels again. [`topics`] and [`topic_frames`] read the
//! recordings of other programs.

mod channel_file;
mod described_channels;
mod error;
mod json_messages;
mod kept_run;
mod lengths;
mod listener;
mod memory_recorder;
mod messages;
mod packet_ring;
mod recorder;
mod recording;
mod records;
mod replay;
mod select_channels;
mod sweeps;
mod topics;
#[cfg(feature = "rerun")]
pub mod view;

pub use error::{RecordingError, RecordingRemedy};
pub use json_messages::{JsonMessage, read_json_messages, write_json_messages};
pub use kept_run::{files_of_run, unpack_run};
pub use listener::{Listener, LivePacket};
pub use memory_recorder::{MemoryDump, MemoryLimits, MemoryRecorder, ShortWindow, Trigger};
pub use messages::{PlainPacket, Recordable, add_packet_types};
pub use recorder::{About, Counts, Recorder};
pub use recording::{Entry, RecordedPacket, Recording};
pub use replay::{FrameLosses, Played, ReplayReport, SweepBeliefs, play};
pub use select_channels::select_channels;
pub use sweeps::{SweepSettings, Sweeps, sweeps};
pub use topics::{Topic, TopicClock, TopicFrames, TopicSelection, Topics, topic_frames, topics};

/// Name of the metadata record with the table of channels.
const METADATA: &str = "tactnet";
/// Metadata entry with the zero of the channels' clock, in nanoseconds since 1970.
const EPOCH: &str = "channel_clock_zero_ns";
/// Metadata entry of a channel of the file: number of the put-port, in hexadecimal.
const SENDER: &str = "sender";
