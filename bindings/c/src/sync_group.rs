//! Waiting for several channels at once.

use crate::bus::Bus;
use crate::get::{GetPort, wait};
use crate::outcome::{Failure, Outcome, close, exclusive, outcome, reference};

/// Get-ports that are waited for together, for one thread at a time.
pub struct SyncGroup {
    group: tactnet_channel::SyncGroup,
}

/// Creates a group of get-ports.
///
/// - `ports`, `count`: the ports, which may be closed before the group
/// - `group`: set to the group; release it with `tactnet_sync_group_close`
///
/// # Safety
/// `ports` points to `count` open ports; the other pointers are valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_sync_group_open(
    bus: *const Bus,
    ports: *const *const GetPort,
    count: usize,
    group: *mut *mut SyncGroup,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let (bus, group) = unsafe { (reference("bus", bus)?, exclusive("group", group)?) };
        *group = std::ptr::null_mut();
        if ports.is_null() && count > 0 {
            return Err(Failure::argument("ports is null"));
        }
        let mut sides: Vec<&dyn tactnet_channel::GetSide> = Vec::new();
        for at in 0..count {
            // SAFETY: by the caller.
            let port = unsafe { reference("a port", *ports.add(at)) }?;
            sides.push(&port.port);
        }
        *group = Box::into_raw(Box::new(SyncGroup {
            group: bus.bus.sync_group(&sides)?,
        }));
        Ok(Outcome::Ok)
    })
}

/// Waits until a port of the group has a packet; `tactnet_get` then takes it.
///
/// - `timeout_ns`: maximum sleep; 0: do not wait; negative: no timeout
/// - `port`: set to the index of the port in the group
///
/// # Safety
/// `group` is open and used by this thread alone, `port` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_sync_group_wait(
    group: *mut SyncGroup,
    timeout_ns: i64,
    port: *mut usize,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let (group, port) = unsafe { (exclusive("group", group)?, exclusive("port", port)?) };
        let once = tactnet_channel::Wait::Block {
            timeout: std::time::Duration::ZERO,
        };
        let Some(found) = group.group.wait(wait(timeout_ns).unwrap_or(once))? else {
            return Ok(Outcome::Timeout);
        };
        *port = found;
        Ok(Outcome::Ok)
    })
}

/// Closes a group. Null is ignored.
///
/// # Safety
/// `group` is null or was opened, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_sync_group_close(group: *mut SyncGroup) {
    // SAFETY: by the caller.
    unsafe { close(group) }
}
