//! Buffers on a device.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;

/// Buffer and its length in 32-bit numbers.
pub(crate) type Buffer = (Handle, usize);

/// Allocates an uninitialised buffer of `len` 32-bit numbers.
pub(crate) fn floats(client: &Client, len: usize) -> Buffer {
    (client.empty(len * size_of::<f32>()), len)
}

/// # Safety
/// The length must be that of the buffer.
pub(crate) unsafe fn buffer((handle, len): &Buffer) -> BufferArg {
    // SAFETY: guaranteed by the caller.
    unsafe { BufferArg::from_raw_parts(handle.clone(), *len) }
}
