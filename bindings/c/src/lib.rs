//! The robot's channels for C. `include/tactnet/channel.h` is generated from this crate.

mod bus;
mod get;
mod outcome;
mod put;
mod sync_group;

/// Number of private 64-bit words in a loan.
pub const LOAN_WORDS: usize = 16;
/// Number of private 64-bit words in a received packet.
pub const RECEIVED_WORDS: usize = 24;

/// Returns the time of the host's monotonic clock, in nanoseconds; `put_ns` of received packets uses the same clock.
#[unsafe(no_mangle)]
pub extern "C" fn tactnet_now_ns() -> u64 {
    tactnet_channel::now_ns()
}
