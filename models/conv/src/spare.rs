//! Memory of large results that are no longer needed, for the results of later operations.
//!
//! The caller owns a result and frees it when its graph is done with it. If the next one were allocated afresh, the system would clear it
//! page by page before it is overwritten; in a training step that takes a twentieth of the time, on one thread. The pool is process-wide;
//! any thread may call these functions.

use super::buffers::Buffers;

/// Values from which on memory is kept.
pub const MIN_LEN: usize = 1 << 14;

/// Most results kept; a training step has fewer at once.
static SPARE: Buffers<Vec<f32>> = Buffers::at_most(16);

/// Returns memory for `len` values: zeros, or from [`MIN_LEN`] values on whatever a buffer of that length held when it was given back.
pub fn take(len: usize) -> Vec<f32> {
    if len < MIN_LEN {
        vec![0.0; len]
    } else {
        SPARE.take(len)
    }
}

/// Returns the bytes that are kept now.
pub fn bytes() -> usize {
    SPARE.bytes()
}

/// Gives memory back for [`take`]; less than [`MIN_LEN`] values are freed.
pub fn give(values: Vec<f32>) {
    if values.len() >= MIN_LEN {
        SPARE.give(values);
    }
}
