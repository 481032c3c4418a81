//! Putting packets.

use std::ffi::{c_char, c_void};

use tactnet_channel::Priority;

use crate::LOAN_WORDS;
use crate::bus::{Bus, Packet};
use crate::outcome::{Failure, Outcome, close, exclusive, outcome, reference, text};

/// How urgent packets are between hosts.
#[repr(C)]
#[allow(dead_code, reason = "for the header: C may pass any number")]
pub enum PacketPriority {
    /// Pictures, recordings.
    Bulk = 0,
    /// Everything else.
    Normal = 1,
    /// Commands.
    High = 2,
    /// Control loops.
    RealTime = 3,
}

/// Puts packets into one channel, for any number of threads.
pub struct PutPort {
    port: tactnet_channel::PutPort<u8>,
    item_bytes: usize,
}

/// A packet that is being written, in shared memory. It is put or given back by the thread that loaned it.
#[repr(C)]
pub struct LoanedPacket {
    /// The items, aligned to 64 bytes; what they hold a former packet left. Null once it was put or given back.
    items: *mut c_void,
    /// How many.
    count: usize,
    /// The library's own.
    opaque: [u64; LOAN_WORDS],
}

type Inner = tactnet_channel::Loan<u8>;
const _: () = assert!(size_of::<Inner>() <= 8 * LOAN_WORDS);

impl LoanedPacket {
    /// What was loaned, once.
    ///
    /// # Safety
    /// `tactnet_loan` has filled it in, or it is all zero.
    unsafe fn take(&mut self) -> Option<Inner> {
        if self.items.is_null() {
            return None;
        }
        self.items = std::ptr::null_mut();
        // SAFETY: `items` is not null, so that `tactnet_loan` wrote a value here that nobody has taken yet.
        Some(unsafe { self.opaque.as_ptr().cast::<Inner>().read_unaligned() })
    }
}

/// Opens a port to put packets into a channel.
///
/// - `channel`: its id, like `skin/right`
/// - `packet`: what it carries
/// - `priority`: a `tactnet_priority`
/// - `port`: is set to the port; give it back with `tactnet_put_port_close`
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
        let priority = match priority {
            0 => Priority::Bulk,
            1 => Priority::Normal,
            2 => Priority::High,
            3 => Priority::RealTime,
            other => {
                return Err(Failure::argument(format!(
                    "priority: expected 0 to 3, found {other}"
                )));
            }
        };
        *port = Box::into_raw(Box::new(PutPort {
            port: bus.bus.put_port_of(channel, packet, priority)?,
            item_bytes: packet.item_bytes,
        }));
        Ok(Outcome::Ok)
    })
}

/// Closes a port; packets on loan are to be put or given back before, and packets that a getter has not looked for yet may be lost to it. Null
/// is nothing.
///
/// # Safety
/// `port` is null or was opened, and is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn tactnet_put_port_close(port: *mut PutPort) {
    // SAFETY: by the caller.
    unsafe { close(port) }
}

impl PutPort {
    fn loan(&self, count: usize) -> Result<Inner, Failure> {
        // Far more than a packet holds where it overflows.
        let bytes = count.saturating_mul(self.item_bytes);
        self.port.loan(bytes).map_err(Failure::from)
    }
}

/// Sends a copy of `count` items.
///
/// # Safety
/// `items` points to `count` items of the port's packet.
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
            // SAFETY: by the caller there are so many bytes, which the loan was made for.
            let items = unsafe { std::slice::from_raw_parts(items.cast::<u8>(), loan.len()) };
            loan.copy_from_slice(items);
        }
        port.port.put(loan)?;
        Ok(Outcome::Ok)
    })
}

/// Loans a packet of `count` items to be written in place, without a copy; then `tactnet_put_loan` or `tactnet_loan_release`.
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
        // SAFETY: by the caller; `loan` may be uninitialised, so that no reference to it is made before it is written.
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
            // There is room for it, as asserted above.
            (&raw mut (*loan).opaque)
                .cast::<Inner>()
                .write_unaligned(inner);
        }
        Ok(Outcome::Ok)
    })
}

/// Sends a loaned packet, which then is no longer the sender's, whatever the outcome.
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
        let taken = taken.ok_or_else(|| Failure::argument("loan: it was put or given back"))?;
        port.port.put(taken)?;
        Ok(Outcome::Ok)
    })
}

/// Gives a loaned packet back unsent. One that was put, null, or all zero is nothing.
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

/// Connects to get-ports that came since the last packet, at a time of the caller's choice; else the next put does it, which then allocates.
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
