//! Analysis of recordings of the catching stack, on a robot or in the simulated world.
//!
//! ```text
//! recording ─┬─> timing  from every exposure to its path, step by step, from the timestamps in the packets
//!             └─> replay  packets through tracker, coordinator and planners; compares the results
//! ```

mod chain;
mod decisions;
mod packets_of;
mod picture;
mod replay;
mod session;
mod timing;

pub use replay::{Compared, Replayed, replay};
pub use session::{read_session, write_session};
pub use timing::{Step, Timing, timing};

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
