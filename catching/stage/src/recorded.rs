//! What recordings of the catching stack tell, of a robot as of the simulated world.
//!
//! ```text
//! tactnet record ─> FILE.mcap ─┬─> timing  from every exposure to its path, step by step, from the stamps in the packets
//!                              └─> replay  circles and poses through the tracker, questions through the planners: the same answers?
//! ```

mod chain;
mod packets_of;
mod picture;
mod replay;
mod session;
mod timing;

pub use replay::{Compared, Replayed, replay};
pub use session::{read_session, write_session};
pub use timing::{Step, Timing, timing};

/// A recording that tells nothing.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// No paths in it.
    #[error(
        "the recording holds no packets of a catching stack; `tactnet catch run --record FILE.mcap` makes one that does"
    )]
    NotCatching,
    /// Times of channels and times in packets cannot be compared.
    #[error(
        "the recording does not say when the channels' clock began, so that times in packets cannot be compared with it"
    )]
    NoClock,
    /// The stack's settings in the recording's table.
    #[error("the recording's table: {0}")]
    Settings(#[from] tactnet_catching_roles::RoleError),
}
