//! Connections between ports that could not be made, since descriptors or shared memory were short.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use iceoryx2::port::{DegradationAction, DegradationCause, DegradationInfo};

/// How many there were.
#[derive(Debug, Clone, Default)]
pub(crate) struct FailedConnections(Arc<AtomicU64>);

impl FailedConnections {
    /// Returns the number.
    pub(crate) fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    /// Begins anew.
    pub(crate) fn forget(&self) {
        self.0.store(0, Ordering::Relaxed);
    }

    /// Returns what counts one: the engine goes on with the connections that it has, and does not try again by itself.
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
