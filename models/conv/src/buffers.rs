//! Pools of large buffers, so that only the first training step allocates (and page-faults).
//!
//! The pools are process-wide, since blocks run one after another and the last batch of an epoch is smaller than the others.
//! Any thread may take and return buffers.

use std::fmt::Debug;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::simd::Octets;

/// Maximum number of bytes in a pool: 1 GiB.
const MAX_BYTES: usize = 1 << 30;
/// Maximum number of buffers in a pool.
pub(super) const MAX_KEPT: usize = 256;

/// Pool of spectra, maps and rows between the stages of a block.
pub(super) static OCTETS: Buffers<Octets> = Buffers::at_most(MAX_KEPT);
/// Pool of winners, gradients and sums.
pub(super) static VALUES: Buffers<Vec<f32>> = Buffers::at_most(MAX_KEPT);
/// Pool of the winners' steps.
pub(super) static BYTES: Buffers<Vec<u8>> = Buffers::at_most(MAX_KEPT);

/// Pool of buffers, ordered by last use, oldest first.
#[derive(Debug)]
pub(super) struct Buffers<B> {
    kept: Mutex<Vec<B>>,
    max: usize,
}

/// Resizable memory that is zero when newly allocated.
pub(super) trait Buffer: Sized {
    fn zeros(len: usize) -> Self;
    /// Returns the capacity in values.
    fn room(&self) -> usize;
    /// Sets the length to `len` values, at most [`Buffer::room`].
    fn set_len(&mut self, len: usize);
    /// Size of a value in bytes.
    const BYTES: usize;
}

impl<T: Copy + Default> Buffer for Vec<T> {
    const BYTES: usize = size_of::<T>();
    fn zeros(len: usize) -> Self {
        vec![T::default(); len]
    }
    fn room(&self) -> usize {
        self.capacity()
    }
    fn set_len(&mut self, len: usize) {
        self.resize(len, T::default());
    }
}

impl Buffer for Octets {
    const BYTES: usize = 32;
    fn zeros(len: usize) -> Self {
        Self::zeros(len)
    }
    fn room(&self) -> usize {
        Self::room(self)
    }
    fn set_len(&mut self, len: usize) {
        Self::set_len(self, len);
    }
}

impl<B> Buffers<B> {
    /// Creates an empty pool that keeps at most `max` buffers.
    pub(super) const fn at_most(max: usize) -> Self {
        Self {
            kept: Mutex::new(Vec::new()),
            max,
        }
    }
}

impl<B: Buffer> Buffers<B> {
    /// Returns a buffer of `len` values: zero if newly allocated, else with arbitrary old content.
    ///
    /// It is the smallest buffer with enough capacity, but not one with capacity for more than 1.5 `len` values.
    pub(super) fn take(&self, len: usize) -> B {
        let mut kept = self.kept();
        let fitting = kept.iter().enumerate().filter(|(_, buffer)| {
            let room = buffer.room();
            (len..=len + len / 2).contains(&room)
        });
        match fitting.min_by_key(|(_, buffer)| buffer.room()) {
            Some((found, _)) => {
                let mut buffer = kept.remove(found);
                drop(kept);
                buffer.set_len(len);
                buffer
            }
            None => {
                drop(kept);
                B::zeros(len)
            }
        }
    }

    /// Adds a buffer to the pool; a full pool frees the least recently used ones.
    pub(super) fn give(&self, buffer: B) {
        let mut kept = self.kept();
        kept.push(buffer);
        let mut bytes: usize = kept.iter().map(|kept| kept.room() * B::BYTES).sum();
        let mut oldest = 0;
        while kept.len() - oldest > self.max || bytes > MAX_BYTES {
            bytes -= kept[oldest].room() * B::BYTES;
            oldest += 1;
        }
        let freed: Vec<B> = kept.drain(..oldest).collect();
        drop(kept);
        drop(freed);
    }

    fn kept(&self) -> MutexGuard<'_, Vec<B>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smaller_buffer_comes_from_a_larger_one_but_not_a_much_larger() {
        let pool: Buffers<Vec<u8>> = Buffers::at_most(2);
        pool.give(vec![7; 12]);
        assert_eq!(pool.take(9), [7; 9], "used, shortened");
        pool.give(vec![7; 12]);
        assert_eq!(pool.take(5), [0; 5], "new");
        assert_eq!(pool.take(12), [7; 12], "still there");
        for len in [3, 8, 20] {
            pool.give(vec![len; usize::from(len)]);
        }
        assert_eq!(pool.take(3), [0; 3], "the oldest was freed");
    }

    #[test]
    fn what_was_shortened_grows_back() {
        let mut octets = Octets::zeros(9);
        octets.set_len(6);
        assert_eq!((octets.len(), octets.room()), (6, 10));
        octets.set_len(9);
        assert_eq!(octets.len(), 9);
    }
}
