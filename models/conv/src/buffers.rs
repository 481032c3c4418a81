//! Pools of large buffers, so that a training step allocates (and page-faults) nothing after the first.

use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::simd::Octets;

/// Most buffers that a pool keeps. A block needs fewer unless many forward passes are pending.
const MAX_KEPT: usize = 64;

/// A pool of buffers, the one that has been unused longest first.
#[derive(Debug)]
pub(super) struct Buffers<B> {
    kept: Mutex<Vec<B>>,
    max: usize,
}

/// Memory of a fixed number of values, zero when allocated.
pub(super) trait Buffer: Sized {
    fn zeros(len: usize) -> Self;
    fn len(&self) -> usize;
}

impl<T: Copy + Default> Buffer for Vec<T> {
    fn zeros(len: usize) -> Self {
        vec![T::default(); len]
    }
    fn len(&self) -> usize {
        self.len()
    }
}

impl Buffer for Octets {
    fn zeros(len: usize) -> Self {
        Self::zeros(len)
    }
    fn len(&self) -> usize {
        <[_]>::len(self)
    }
}

impl<B> Default for Buffers<B> {
    fn default() -> Self {
        Self::at_most(MAX_KEPT)
    }
}

impl<B> Buffers<B> {
    /// Returns an empty pool that keeps at most `max` buffers.
    pub(super) const fn at_most(max: usize) -> Self {
        Self {
            kept: Mutex::new(Vec::new()),
            max,
        }
    }
}

impl<B: Buffer> Buffers<B> {
    /// Returns a buffer of `len` values: zero if newly allocated, else with its former contents.
    pub(super) fn take(&self, len: usize) -> B {
        let mut kept = self.kept();
        match kept.iter().position(|buffer| buffer.len() == len) {
            Some(found) => kept.remove(found),
            None => {
                drop(kept);
                B::zeros(len)
            }
        }
    }

    /// Adds a buffer to the pool; a full pool frees the one that has been unused longest.
    pub(super) fn give(&self, buffer: B) {
        let mut kept = self.kept();
        let oldest = (kept.len() == self.max).then(|| kept.remove(0));
        kept.push(buffer);
        drop(kept);
        drop(oldest);
    }

    fn kept(&self) -> MutexGuard<'_, Vec<B>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
