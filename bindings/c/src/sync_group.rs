//! Waiting for any of several channels.

use crate::bus::Bus;
use crate::get::{GetPort, wait};
use crate::outcome::{Failure, Outcome, close, exclusive, outcome, reference};

/// Get-ports that are waited for together, for one thread at a time.
pub struct SyncGroup {
    group: tactnet_channel::SyncGroup,
}

/// Puts get-ports of a bus into a group.
///
/// - `ports`, `count`: the ports, which may be closed before the group
/// - `group`: is set to the group; give it back with `tactnet_sync_group_close`
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

/// Waits until any port of a group has a packet, which `tactnet_get` then takes.
///
/// - `timeout_ns`: 0: look once; below 0: for ever
/// - `port`: is set to the port's place in the group
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

/// Closes a group. Null is nothing.
///
/// # Safety
/// `group` is null or was opened, and is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_sync_group_close(group: *mut SyncGroup) {
    // SAFETY: by the caller.
    unsafe { close(group) }
}
