//! Frames lost by a classifier in another process.

use std::time::Duration;

use tactnet_channel::{Bus, GetPort, Start, Table, Wait};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::TactileStatus;

use crate::RecordingError;

/// Counter of the frames that the classifier has lost since this was opened, from its status.
pub struct FrameLosses {
    status: GetPort<TactileStatus>,
    before: u64,
}

impl FrameLosses {
    /// Reads the current count.
    ///
    /// # Errors
    /// No classifier serves on these channels.
    pub fn open(bus: &Bus, table: &Table) -> Result<Self, RecordingError> {
        let config = ServeConfig::of(table)?;
        let status = bus.get_port(config.status.as_str(), Start::Now)?;
        let mut losses = Self { status, before: 0 };
        losses.before = losses.newest()?.ok_or(RecordingError::NoClassifier)?;
        Ok(losses)
    }

    /// Returns the number of frames lost since then.
    ///
    /// # Errors
    /// The classifier has ended.
    pub fn since(&self) -> Result<u64, RecordingError> {
        let now = self.newest()?.ok_or(RecordingError::ClassifierGone)?;
        Ok(now.saturating_sub(self.before))
    }

    fn newest(&self) -> Result<Option<u64>, RecordingError> {
        while self.status.try_get()?.is_some() {}
        let patience = Wait::Block {
            timeout: Duration::from_secs(2),
        };
        let status = self.status.get(patience)?;
        Ok(status.and_then(|status| Some(status.first()?.counters.dropped_frames)))
    }
}
