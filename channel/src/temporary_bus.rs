//! Buses of a single process, for tests and tools.

use crate::{Table, remove_abandoned_buses, remove_bus};

/// Returns a bus name that is unique to this process, and removes buses that killed processes have left.
///
/// - `purpose`: prefix of the name
pub fn temporary_bus_name(purpose: &str) -> String {
    // An old bus that cannot be removed does no harm.
    let _ = remove_abandoned_buses(purpose);
    format!("{purpose}{}", std::process::id())
}

/// Removes the shared memory of a bus when dropped.
///
/// ```
/// use tactnet_channel::{ChannelConfig, Hub, Table, TemporaryBus, temporary_bus_name};
///
/// let table = Table::new(&temporary_bus_name("doc")).with("force", ChannelConfig::of::<f32>(3));
/// let _remove_at_the_end = TemporaryBus(&table);
/// let hub = Hub::spawn(&table)?;
/// hub.stop()?;
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
pub struct TemporaryBus<'a>(pub &'a Table);

impl Drop for TemporaryBus<'_> {
    fn drop(&mut self) {
        // A bus that cannot be removed does no harm.
        let _ = remove_bus(self.0);
    }
}
