//! Large buffers that are handed out again, so that a training step allocates (and page-faults) nothing after the first.

use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::simd::Octets;

/// Buffers kept at rest at most; a block needs fewer unless many forward passes wait for their backward pass.
const MOST: usize = 64;

/// Buffers at rest.
#[derive(Debug)]
pub(super) struct Buffers<B>(Mutex<Vec<B>>);

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
        Self(Mutex::new(Vec::new()))
    }
}

impl<B: Buffer> Buffers<B> {
    /// A buffer of `len` values, zero at first, with whatever was in it when it is reused.
    pub(super) fn take(&self, len: usize) -> B {
        let mut resting = self.resting();
        match resting.iter().position(|buffer| buffer.len() == len) {
            Some(found) => resting.swap_remove(found),
            None => {
                drop(resting);
                B::zeros(len)
            }
        }
    }

    /// Puts a buffer to rest.
    pub(super) fn give(&self, buffer: B) {
        let mut resting = self.resting();
        if resting.len() < MOST {
            resting.push(buffer);
        }
    }

    fn resting(&self) -> MutexGuard<'_, Vec<B>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
