//! Packets: plain data that is read where it was written, without serialization.

use bytemuck::{AnyBitPattern, NoUninit};

/// Item of a packet: plain `#[repr(C)]` data without padding or pointers. A packet holds one or more items.
///
/// A port compares name, size and version with the channel when it opens, so programs that disagree never exchange
/// data.
///
/// ```
/// use bytemuck::{Pod, Zeroable};
/// #[repr(C)]
/// #[derive(Clone, Copy, Pod, Zeroable)]
/// struct Imu { acceleration: [f32; 3], rate: [f32; 3] } // m/s², rad/s
/// impl tactnet_packet::Packet for Imu {
///     const NAME: &'static str = "Imu";
///     const VERSION: u32 = 1;
/// }
/// ```
pub trait Packet: AnyBitPattern + NoUninit + Send + Sync {
    /// Name that both ends use.
    const NAME: &'static str;
    /// Increased whenever layout or meaning changes.
    const VERSION: u32;
}

macro_rules! plain {
    ($($number:ident)*) => { $(
        impl Packet for $number {
            const NAME: &'static str = stringify!($number);
            const VERSION: u32 = 1;
        }
    )* };
}
plain!(u8 u16 u32 u64 i8 i16 i32 i64 f32 f64);
