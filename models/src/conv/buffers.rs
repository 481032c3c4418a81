//! Large buffers that are handed out again, so that a training step allocates (and page-faults) nothing after the first.

use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::simd::Octets;

/// Buffers kept at rest at most; a block needs fewer unless many forward passes wait for their backward pass.
const MOST: usize = 64;

/// Buffers at rest, the one that has rested longest first.
#[derive(Debug)]
pub(super) struct Buffers<B> {
    resting: Mutex<Vec<B>>,
    most: usize,
}

/// Something that holds a number of values, zero at first.
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
        Self::at_most(MOST)
    }
}

impl<B> Buffers<B> {
    /// Of which at most `most` rest.
    pub(super) const fn at_most(most: usize) -> Self {
        Self {
            resting: Mutex::new(Vec::new()),
            most,
        }
    }
}

impl<B: Buffer> Buffers<B> {
    /// A buffer of `len` values, zero at first, with whatever was in it when it is reused.
    pub(super) fn take(&self, len: usize) -> B {
        let mut resting = self.resting();
        match resting.iter().position(|buffer| buffer.len() == len) {
            Some(found) => resting.remove(found),
            None => {
                drop(resting);
                B::zeros(len)
            }
        }
    }

    /// Puts a buffer to rest; where there are too many, the one that has rested longest is freed.
    pub(super) fn give(&self, buffer: B) {
        let mut resting = self.resting();
        let oldest = (resting.len() == self.most).then(|| resting.remove(0));
        resting.push(buffer);
        drop(resting);
        drop(oldest);
    }

    fn resting(&self) -> MutexGuard<'_, Vec<B>> {
        self.resting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
