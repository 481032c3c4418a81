//! Reuse of the memory of large results.
//!
//! The caller owns a result and frees it with its autodiff graph. If the next result were newly allocated, the system would first clear
//! its pages, which takes a twentieth of a training step on one thread. The pool is process-wide, and any thread may call these functions.

use super::buffers::Buffers;

/// Minimum number of values for which memory is kept.
pub const MIN_LEN: usize = 1 << 14;

/// Pool of at most 16 results; a training step has fewer at once.
static SPARE: Buffers<Vec<f32>> = Buffers::at_most(16);

/// Returns memory for `len` values: zeros, or from [`MIN_LEN`] values on possibly the content of an earlier result.
pub fn take(len: usize) -> Vec<f32> {
    if len < MIN_LEN {
        vec![0.0; len]
    } else {
        SPARE.take(len)
    }
}

/// Keeps memory for [`take`]; frees it if it has fewer than [`MIN_LEN`] values.
pub fn give(values: Vec<f32>) {
    if values.len() >= MIN_LEN {
        SPARE.give(values);
    }
}
