//! A bus that nobody else uses.

use tactnet_channel::{Table, remove_bus};

/// A bus whose shared memory is removed when this is dropped.
pub struct OwnBus<'a>(pub &'a Table);

impl Drop for OwnBus<'_> {
    fn drop(&mut self) {
        // Nothing depends on it.
        let _ = remove_bus(self.0);
    }
}
