//! Counter of failed connections between ports.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};

/// Number of connections that failed because file descriptors or shared memory ran out.
#[derive(Debug, Clone, Default)]
pub(crate) struct FailedConnections(Arc<AtomicU64>);

impl FailedConnections {
    /// Returns the number.
    pub(crate) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Resets the number to zero.
    pub(crate) fn forget(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// Returns a callback for iceoryx2 that counts one failure. Iceoryx2 keeps its other connections and does not
    /// retry.
    pub(crate) fn counter(
        &self,
    ) -> impl Fn(DegradationCause, &DegradationInfo) -> DegradationAction + Send + 'static {
        let count = self.0.clone();
        move |_, _| {
            count.fetch_add(1, Ordering::Relaxed);
            DegradationAction::Ignore
        }
    }
}
