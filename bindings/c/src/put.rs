//! Ports that put packets.

use std::ffi::{c_char, c_void};

use tactnet_channel::Priority;

use crate::LOAN_WORDS;
use crate::bus::{Bus, Packet};
use crate::outcome::{Failure, Outcome, close, exclusive, outcome, reference, text};

/// Priority of a port, on a host as between hosts: urgent packets are delivered before waiting bulk.
#[repr(C)]
#[allow(dead_code, reason = "for the header: C may pass any number")]
pub enum PacketPriority {
    /// For images and recordings.
    Bulk = 0,
    /// For everything else.
    Normal = 1,
    /// For commands.
    High = 2,
    /// For control loops.
    RealTime = 3,
}

/// Returns a priority by its number.
pub(crate) fn priority(number: u32) -> Result<Priority, Failure> {
    match number {
        0..=3 => Ok(Priority::from_number(number as u8)),
        other => Err(Failure::argument(format!(
            "priority: expected 0 to 3, found {other}"
        ))),
    }
}

/// Packets of a put-port that one get-port has lost.
#[repr(C)]
pub struct GetterLoss {
    /// Number of the get-port, as `tactnet_get_port_number` returns it.
    getter: u64,
    /// Packets that were overwritten in its ring.
    packets: u64,
}

/// Puts packets into one channel, for any number of threads.
pub struct PutPort {
    port: tactnet_channel::PutPort<u8>,
    item_bytes: usize,
}

/// A packet that is being written, in shared memory. The thread that loaned it puts or releases it.
#[repr(C)]
pub struct LoanedPacket {
    /// Items, aligned to 64 bytes, with undefined content. Null after the put or release.
    items: *mut c_void,
    /// Number of items.
    count: usize,
    /// Private to the library.
    opaque: [u64; LOAN_WORDS],
}

type Inner = tactnet_channel::Loan<u8>;
const _: () = assert!(size_of::<Inner>() <= 8 * LOAN_WORDS);

impl LoanedPacket {
    /// Takes the loan out, once.
    ///
    /// # Safety
    /// `tactnet_loan` has filled it in, or it is all zero.
    unsafe fn take(&mut self) -> Option<Inner> {
        if self.items.is_null() {
            return None;
        }
        self.items = std::ptr::null_mut();
        // SAFETY: `items` is not null, so `tactnet_loan` wrote a value here that was not taken yet.
        Some(unsafe { self.opaque.as_ptr().cast::<Inner>().read_unaligned() })
    }
}

/// Opens a port that puts packets into a channel.
///
/// - `channel`: id, like `skin/right`
/// - `packet`: packet type of the channel
/// - `priority`: a `tactnet_priority`
/// - `port`: set to the port; release it with `tactnet_put_port_close`
///
/// # Safety
/// The pointers are valid.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put_port_open(
    bus: *const Bus,
    channel: *const c_char,
    packet: *const Packet,
    priority: u32,
    port: *mut *mut PutPort,
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
        let priority = self::priority(priority)?;
        *port = Box::into_raw(Box::new(PutPort {
            port: bus.bus.put_port_of(channel, packet, priority)?,
            item_bytes: packet.item_bytes,
        }));
        Ok(Outcome::Ok)
    })
}

/// Closes a port; put or release its loans before. Get-ports still get its last packets. Null is ignored.
///
/// # Safety
/// `port` is null or was opened, and is not used afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put_port_close(port: *mut PutPort) {
    // SAFETY: by the caller.
    unsafe { close(port) }
}

impl PutPort {
    fn loan(&self, count: usize) -> Result<Inner, Failure> {
        // A saturated size is far beyond the maximum and is refused.
        let bytes = count.saturating_mul(self.item_bytes);
        self.port.loan(bytes).map_err(Failure::from)
    }
}

/// Sends a copy of `count` items.
///
/// # Safety
/// `items` points to `count` items of the port's packet type.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put(
    port: *const PutPort,
    items: *const c_void,
    count: usize,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let port = unsafe { reference("port", port) }?;
        if items.is_null() && count > 0 {
            return Err(Failure::argument("items is null"));
        }
        let mut loan = port.loan(count)?;
        if count > 0 {
            // SAFETY: by the caller `items` has as many bytes as the loan.
            let items = unsafe { std::slice::from_raw_parts(items.cast::<u8>(), loan.len()) };
            loan.copy_from_slice(items);
        }
        port.port.put(loan)?;
        Ok(Outcome::Ok)
    })
}

/// Loans a packet of `count` items to be written in place, without a copy. End the loan with `tactnet_put_loan` or
/// `tactnet_loan_release`.
///
/// # Safety
/// `port` is open, `loan` can be written and holds no packet.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_loan(
    port: *const PutPort,
    count: usize,
    loan: *mut LoanedPacket,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller. `loan` may be uninitialized, so it is written before any reference to it exists.
        let port = unsafe { reference("port", port) }?;
        if loan.is_null() {
            return Err(Failure::argument("loan is null"));
        }
        // SAFETY: by the caller, for all that follow.
        unsafe { (&raw mut (*loan).items).write(std::ptr::null_mut()) };
        let mut inner = port.loan(count)?;
        unsafe {
            (&raw mut (*loan).items).write(inner.as_mut_ptr().cast());
            (&raw mut (*loan).count).write(count);
            // The assertion above ensures that it fits.
            (&raw mut (*loan).opaque)
                .cast::<Inner>()
                .write_unaligned(inner);
        }
        Ok(Outcome::Ok)
    })
}

/// Sends a loaned packet. The loan ends, whatever the outcome.
///
/// # Safety
/// `port` is open, `loan` was filled in by `tactnet_loan`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put_loan(
    port: *const PutPort,
    loan: *mut LoanedPacket,
) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let taken = unsafe { exclusive("loan", loan)?.take() };
        // SAFETY: by the caller.
        let port = unsafe { reference("port", port) }?;
        let taken =
            taken.ok_or_else(|| Failure::argument("loan: it was already put or released"))?;
        port.port.put(taken)?;
        Ok(Outcome::Ok)
    })
}

/// Releases a loaned packet unsent. One that was put, null, or all zeros is ignored.
///
/// # Safety
/// `loan` is null, all zero, or was filled in by `tactnet_loan`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_loan_release(loan: *mut LoanedPacket) {
    // SAFETY: by the caller.
    if let Some(loan) = unsafe { loan.as_mut() } {
        // SAFETY: by the caller.
        drop(unsafe { loan.take() });
    }
}

/// Returns the number of get-ports that have lost packets of this port, because they took them too slowly.
///
/// - `losses`: filled with the first `most` of them
///
/// # Safety
/// `port` is null or open; `losses` points to `most` elements.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put_port_losses(
    port: *const PutPort,
    losses: *mut GetterLoss,
    most: usize,
) -> usize {
    // SAFETY: by the caller.
    let Some(port) = (unsafe { port.as_ref() }) else {
        return 0;
    };
    let found = port.port.losses();
    if !losses.is_null() {
        for (at, loss) in found.iter().enumerate().take(most) {
            let loss = GetterLoss {
                getter: loss.getter,
                packets: loss.packets,
            };
            // SAFETY: by the caller.
            unsafe { losses.add(at).write(loss) };
        }
    }
    found.len()
}

/// Connects to new get-ports now. Otherwise the next put does so, and allocates.
///
/// # Safety
/// `port` is open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put_port_connect(port: *const PutPort) -> Outcome {
    outcome(|| {
        // SAFETY: by the caller.
        let port = unsafe { reference("port", port) }?;
        port.port.send_history()?;
        Ok(Outcome::Ok)
    })
}
