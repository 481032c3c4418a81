//! Check for a running hub, for clients that wait.

use std::fs::{File, TryLockError};

use crate::memory_folder::bus_folder;
use crate::{ChannelError, Table};

/// Returns true while a hub of this bus runs on this host.
///
/// # Errors
/// The folder of the bus cannot be used.
///
/// ```
/// use tactnet_channel::{Hub, Table, TemporaryBus, hub_runs, temporary_bus_name};
///
/// let table = Table::new(&temporary_bus_name("doc-hub-runs"));
/// let _remove_at_the_end = TemporaryBus(&table);
/// let hub = Hub::start(&table)?;
/// assert!(hub_runs(&table)?);
/// drop(hub);
/// assert!(!hub_runs(&table)?);
/// # Ok::<_, tactnet_channel::ChannelError>(())
/// ```
pub fn hub_runs(table: &Table) -> Result<bool, ChannelError> {
    // The hub holds this file's lock. A hub that starts meanwhile tries again.
    let Ok(file) = File::open(bus_folder(table)?.join(HUB_LOCK)) else {
        return Ok(false);
    };
    Ok(matches!(
        file.try_lock_shared(),
        Err(TryLockError::WouldBlock)
    ))
}

/// Name of the file that a running hub locks.
pub(crate) const HUB_LOCK: &str = "hub";
