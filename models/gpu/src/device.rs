//! Buffers on a device.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;

/// A buffer, and the 32-bit numbers that it holds.
pub(crate) type Buffer = (Handle, usize);

/// A buffer of `len` 32-bit numbers, not set.
pub(crate) fn floats(client: &Client, len: usize) -> Buffer {
    (client.empty(len * size_of::<f32>()), len)
}

/// # Safety
/// The length must be the buffer's.
pub(crate) unsafe fn buffer((handle, len): &Buffer) -> BufferArg {
    // SAFETY: as the caller promises.
    unsafe { BufferArg::from_raw_parts(handle.clone(), *len) }
}
