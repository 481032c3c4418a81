//! Buses and packet types.

use std::ffi::c_char;

use tactnet_channel::{Domain, PacketType, Table};

use crate::outcome::{Failure, Outcome, close, exclusive, outcome, text};

/// Access to the channels of a table, for any number of threads.
pub struct Bus {
    pub(crate) bus: tactnet_channel::Bus,
}

/// Packet type of a port. Both ends of a channel must use the same.
#[repr(C)]
pub struct Packet {
    /// Name of the type, like `SkinFrame`.
    name: *const c_char,
    /// Version of the type.
    version: u32,
    /// Size of one item, in bytes.
    bytes: usize,
}

impl Packet {
    /// # Safety
    /// `name` is null or a text.
    pub(crate) unsafe fn named(&self) -> Result<PacketType<'_>, Failure> {
        if self.bytes == 0 {
            return Err(Failure::argument(
                "packet: expected items of at least 1 byte",
            ));
        }
        Ok(PacketType {
            // SAFETY: by the caller.
            name: unsafe { text("packet.name", self.name) }?,
            version: self.version,
            item_bytes: self.bytes,
        })
    }
}

/// Opens a bus; a hub of this host must run with the same table.
///
/// - `table`: path of the hub's table
/// - `bus`: set to the bus; release it with `tactnet_bus_close`
///
/// # Safety
/// `table` is a text, `bus` can be written.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_bus_open(table: *const c_char, bus: *mut *mut Bus) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let (table, bus) = unsafe { (text("table", table)?, exclusive("bus", bus)?) };
        *bus = std::ptr::null_mut();
        let table = Table::load(table.as_ref()).map_err(Failure::table)?;
        let opened = tactnet_channel::Bus::open(Domain::Host, &table)?;
        *bus = Box::into_raw(Box::new(Bus { bus: opened }));
        Ok(Outcome::Ok)
    })
}

/// Closes a bus; its ports stay open. Null is ignored.
///
/// # Safety
/// `bus` is null or was opened, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_bus_close(bus: *mut Bus) {
    // SAFETY: by the caller.
    unsafe { close(bus) }
}
