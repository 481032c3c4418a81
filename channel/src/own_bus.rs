//! A bus that nobody else uses.

use crate::{Table, remove_abandoned_buses, remove_bus};

/// Returns the name of a bus of this process, after those of killed ones have been removed.
///
/// - `purpose`: how it begins
pub fn own_bus_name(purpose: &str) -> String {
    // Nothing depends on it.
    let _ = remove_abandoned_buses(purpose);
    format!("{purpose}{}", std::process::id())
}

/// A bus whose shared memory is removed when this is dropped.
pub struct OwnBus<'a>(pub &'a Table);

impl Drop for OwnBus<'_> {
    fn drop(&mut self) {
        // Nothing depends on it.
        let _ = remove_bus(self.0);
    }
}
