//! Buses and packet types.

use std::ffi::c_char;

use tactnet_channel::{ChannelConfig, Domain, PacketType, Table};

use crate::outcome::{Failure, Outcome, close, exclusive, outcome, reference, text};

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

/// Resources of a channel that is created at run time; a zero stands for the default.
#[repr(C)]
pub struct ChannelResources {
    /// Maximum number of items in a packet; 1 by default.
    items: usize,
    /// Length of a get-port's ring for one put-port, in packets; 16 by default.
    depth: usize,
    /// Maximum number of put-ports; 1 by default.
    put_ports: usize,
    /// Maximum number of get-ports; 8 by default.
    get_ports: usize,
    /// Number of last packets of every put-port that a new get-port can request; 0 by default.
    history: usize,
}

/// Creates a channel that is not in the table, for as long as the bus is open.
///
/// - `channel`: id of the new channel, which other clients open by it
/// - `packet`: packet type of the channel
///
/// # Safety
/// The pointers are valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_channel_create(
    bus: *const Bus,
    channel: *const c_char,
    packet: *const Packet,
    resources: *const ChannelResources,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let (bus, channel, packet, resources) = unsafe {
            (
                reference("bus", bus)?,
                text("channel", channel)?,
                reference("packet", packet)?.named()?,
                reference("resources", resources)?,
            )
        };
        let default = ChannelConfig::of::<u8>(1);
        let or = |value: usize, default: usize| if value == 0 { default } else { value };
        bus.bus.create_channel(
            channel,
            ChannelConfig {
                packet: packet.name.into(),
                version: packet.version,
                item_bytes: packet.item_bytes,
                items: or(resources.items, 1),
                depth: or(resources.depth, default.depth),
                put_ports: or(resources.put_ports, default.put_ports),
                get_ports: or(resources.get_ports, default.get_ports),
                history: resources.history,
                ..default
            },
        )?;
        Ok(Outcome::Ok)
    })
}
