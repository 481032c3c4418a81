//! Ports that get packets.

use std::ffi::{c_char, c_void};
use std::time::Duration;

use tactnet_channel::{Start, Wait};

use crate::RECEIVED_WORDS;
use crate::bus::{Bus, Packet};
use crate::outcome::{Failure, Outcome, close, exclusive, outcome, reference, text};

/// Gets packets from one channel, for one thread at a time.
pub struct GetPort {
    pub(crate) port: tactnet_channel::GetPort<u8>,
    item_bytes: usize,
}

/// A received packet in its sender's memory. Release it soon with `tactnet_received_release`: a port holds only a few.
#[repr(C)]
pub struct ReceivedPacket {
    /// Items, aligned to 64 bytes, read-only. Null after the release.
    items: *const c_void,
    /// Number of items.
    count: usize,
    /// Random number of the put-port that sent it.
    sender: u64,
    /// Sequence number of the packet at that put-port, from 0.
    sequence: u64,
    /// Time of the put, by the sender's `tactnet_now_ns`.
    put_ns: u64,
    /// 1 if it came from another host, whose clock `put_ns` then uses; otherwise 0.
    remote: u32,
    /// Priority of the put-port.
    priority: u32,
    /// Private to the library.
    opaque: [u64; RECEIVED_WORDS],
}

type Inner = tactnet_channel::Received<u8>;
const _: () = assert!(size_of::<Inner>() <= 8 * RECEIVED_WORDS);

/// Returns how to wait; `None` for a timeout of zero.
pub(crate) fn wait(timeout_ns: i64) -> Option<Wait> {
    let timeout = match timeout_ns {
        0 => return None,
        // About three centuries.
        ..0 => Duration::from_nanos(i64::MAX as u64),
        _ => Duration::from_nanos(timeout_ns as u64),
    };
    Some(Wait::Block { timeout })
}

/// Opens a port that gets packets of a channel.
///
/// - `channel`: id, like `tactile/belief`
/// - `packet`: packet type of the channel
/// - `history`: number of earlier packets to get from every sender, if the channel keeps them; 0: only new ones
/// - `port`: set to the port; release it with `tactnet_get_port_close`
///
/// # Safety
/// The pointers are valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_get_port_open(
    bus: *const Bus,
    channel: *const c_char,
    packet: *const Packet,
    history: usize,
    port: *mut *mut GetPort,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let (bus, channel, packet, port) = unsafe {
            (
                reference("bus", bus)?,
                text("channel", channel)?,
                reference("packet", packet)?.named()?,
                exclusive("port", port)?,
            )
        };
        *port = std::ptr::null_mut();
        let start = match history {
            0 => Start::Now,
            packets => Start::History(packets),
        };
        *port = Box::into_raw(Box::new(GetPort {
            port: bus.bus.get_port_of(channel, packet, start)?,
            item_bytes: packet.item_bytes,
        }));
        Ok(Outcome::Ok)
    })
}

/// Closes a port; release its packets before. Null is ignored.
///
/// # Safety
/// `port` is null or was opened, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_get_port_close(port: *mut GetPort) {
    // SAFETY: by the caller.
    unsafe { close(port) }
}

/// Gets the next packet.
///
/// - `timeout_ns`: maximum sleep; 0: do not wait; negative: no timeout
///
/// # Safety
/// `port` is open and used by this thread alone, `received` can be written and holds no packet.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_get(
    port: *mut GetPort,
    timeout_ns: i64,
    received: *mut ReceivedPacket,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let port = unsafe { reference("port", port) }?;
        if received.is_null() {
            return Err(Failure::argument("received is null"));
        }
        let found = match wait(timeout_ns) {
            None => port.port.try_get()?,
            Some(wait) => port.port.get(wait)?,
        };
        // Written field by field, since C may pass uninitialized memory and polling must only write `items`.
        // SAFETY: by the caller, for all that follow.
        unsafe { (&raw mut (*received).items).write(std::ptr::null()) };
        let Some(inner) = found else {
            return Ok(Outcome::Timeout);
        };
        let header = inner.header();
        unsafe {
            (&raw mut (*received).items).write(inner.as_ptr().cast());
            (&raw mut (*received).count).write(inner.len() / port.item_bytes);
            (&raw mut (*received).sender).write(header.sender);
            (&raw mut (*received).sequence).write(header.sequence);
            (&raw mut (*received).put_ns).write(header.put_ns);
            (&raw mut (*received).remote).write(header.remote.into());
            (&raw mut (*received).priority).write(header.priority.into());
            // The assertion above ensures that it fits.
            (&raw mut (*received).opaque)
                .cast::<Inner>()
                .write_unaligned(inner);
        }
        Ok(Outcome::Ok)
    })
}

/// Releases a packet. A released one, null, or all zeros is ignored.
///
/// # Safety
/// `received` is null, all zero, or was filled in by `tactnet_get`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_received_release(received: *mut ReceivedPacket) {
    // SAFETY: by the caller.
    let Some(received) = (unsafe { received.as_mut() }) else {
        return;
    };
    if !received.items.is_null() {
        received.items = std::ptr::null();
        // SAFETY: `items` was not null, so `tactnet_get` wrote a value here that was not taken yet.
        drop(unsafe { received.opaque.as_ptr().cast::<Inner>().read_unaligned() });
    }
}

/// Sets the priority of a port in its sync groups, which name ports of high priority first.
///
/// - `priority`: a `tactnet_priority`
///
/// # Safety
/// `port` is open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_get_port_set_priority(
    port: *const GetPort,
    priority: u32,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let port = unsafe { reference("port", port) }?;
        port.port.set_priority(crate::put::priority(priority)?);
        Ok(Outcome::Ok)
    })
}

/// Returns the random number of a port, for `tactnet_put_port_losses`; 0 for null.
///
/// # Safety
/// `port` is null or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_get_port_number(port: *const GetPort) -> u64 {
    // SAFETY: by the caller.
    unsafe { port.as_ref() }.map_or(0, |port| port.port.number())
}

/// Returns the number of packets since the opening that were put but did not arrive, because the ring was full or the
/// network too slow.
///
/// # Safety
/// `port` is null or open, and used by this thread alone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_get_port_lost(port: *const GetPort) -> u64 {
    // SAFETY: by the caller.
    unsafe { port.as_ref() }.map_or(0, |port| port.port.lost())
}
