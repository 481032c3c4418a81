//! The robot's channels for C: `include/tactnet/channel.h` is generated from here.

mod bus;
mod get;
mod outcome;
mod put;
mod sync_group;

/// 64-bit words of a loan that belong to the library.
pub const LOAN_WORDS: usize = 16;
/// 64-bit words of a received packet that belong to the library.
pub const RECEIVED_WORDS: usize = 24;

/// Returns nanoseconds of the host's monotonic clock, of which `put_ns` of a received packet are.
#[unsafe(no_mangle)]
pub extern "C" fn tactnet_now_ns() -> u64 {
    tactnet_channel::now_ns()
}
