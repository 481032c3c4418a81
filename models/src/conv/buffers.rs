//! Large buffers that are handed out again, so that a training step allocates (and page-faults) nothing after the first.

use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Buffers kept at rest at most; a block needs fewer unless many forward passes wait for their backward pass.
const MOST: usize = 64;

/// Buffers at rest.
#[derive(Debug)]
pub(super) struct Buffers<T>(Mutex<Vec<Vec<T>>>);

impl<T> Default for Buffers<T> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T: Copy + Default> Buffers<T> {
    /// A buffer of `len` values, zero at first, with whatever was in it when it is reused.
    pub(super) fn take(&self, len: usize) -> Vec<T> {
        let mut resting = self.resting();
        match resting.iter().position(|buffer| buffer.len() == len) {
            Some(found) => resting.swap_remove(found),
            None => {
                drop(resting);
                vec![T::default(); len]
            }
        }
    }

    /// Puts a buffer to rest.
    pub(super) fn give(&self, buffer: Vec<T>) {
        let mut resting = self.resting();
        if resting.len() < MOST {
            resting.push(buffer);
        }
    }

    fn resting(&self) -> MutexGuard<'_, Vec<Vec<T>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
