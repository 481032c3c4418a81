//! Source of test packets.

use std::time::{Duration, Instant};

use tactnet_channel::{ChannelError, PutPort};

/// Puts `count` packets of zeros that begin with their number, little-endian, or until `stopped` returns true.
///
/// - `bytes`: size of a packet
/// - `rate_hz`: packets per second; 0: as fast as possible
///
/// # Errors
/// The transport has failed.
pub fn put_numbered(
    port: &PutPort<u8>,
    bytes: usize,
    rate_hz: f64,
    count: u64,
    stopped: &dyn Fn() -> bool,
) -> Result<(), ChannelError> {
    let begun = Instant::now();
    let mut sent = 0u64;
    while !stopped() && sent < count {
        let mut packet = port.loan(bytes)?;
        let number = sent.to_le_bytes();
        let room = bytes.min(number.len());
        packet[..room].copy_from_slice(&number[..room]);
        port.put(packet)?;
        sent += 1;
        if rate_hz > 0.0 {
            let due = begun + Duration::from_secs_f64(sent as f64 / rate_hz);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
    }
    Ok(())
}
