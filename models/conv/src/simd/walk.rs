//! Strided reads with a single bounds check.

use std::marker::PhantomData;

use super::{Lanes, Octet};

/// Iterator over a slice in equal strides that reads `PAIRS` pairs of values at fixed offsets from each position.
///
/// The constructor checks all bounds, which keeps inner loops free of checks.
#[derive(Debug, Clone)]
pub(crate) struct Walk<'a, T, L, const PAIRS: usize> {
    values: &'a [T],
    lanes: PhantomData<L>,
    stride: usize,
    offsets: [[usize; 2]; PAIRS],
    at: usize,
    end: usize,
}

/// Type of value that a walk reads.
pub(crate) trait Stop<L>: Sized {
    type Read: Copy;
    /// Number of values per read.
    const SPAN: usize;
    /// # Safety
    /// `from` must be valid for reads of `SPAN` values.
    unsafe fn read(from: *const Self) -> Self::Read;
}

/// Reads plain values.
impl<L> Stop<L> for f32 {
    type Read = f32;
    const SPAN: usize = 1;
    #[inline(always)]
    unsafe fn read(from: *const f32) -> f32 {
        // SAFETY: the caller guarantees one value.
        unsafe { *from }
    }
}

/// Reads octets as vectors.
impl<L: Lanes> Stop<L> for Octet {
    type Read = L;
    const SPAN: usize = L::OCTETS;
    #[inline(always)]
    unsafe fn read(from: *const Octet) -> L {
        // SAFETY: the caller guarantees the octets of a vector.
        unsafe { L::load_from(from.cast()) }
    }
}

impl<'a, L, T: Stop<L>, const PAIRS: usize> Walk<'a, T, L, PAIRS> {
    /// Panics unless every read is within `values`.
    #[inline(always)]
    pub(crate) fn new(
        values: &'a [T],
        stride: usize,
        stops: usize,
        offsets: [[usize; 2]; PAIRS],
    ) -> Self {
        let mut furthest = 0;
        for pair in offsets {
            furthest = furthest.max(pair[0]).max(pair[1]);
        }
        let inside = match stops.checked_sub(1) {
            Some(last) => last
                .checked_mul(stride)
                .and_then(|at| at.checked_add(furthest + T::SPAN - 1))
                .is_some_and(|at| at < values.len()),
            None => true,
        };
        assert!(inside && stride > 0, "a walk stays within its slice");
        Self {
            values,
            lanes: PhantomData,
            stride,
            offsets,
            at: 0,
            end: stops * stride,
        }
    }

    /// Returns the values at the next position.
    #[inline(always)]
    pub(crate) fn step(&mut self) -> Option<[[T::Read; 2]; PAIRS]> {
        if self.at == self.end {
            return None;
        }
        let at = self.at;
        self.at += self.stride;
        // SAFETY: `at` is one of the positions whose last read `new` has checked.
        let read = |offset: usize| unsafe { T::read(self.values.as_ptr().add(at + offset)) };
        let mut found = [[read(self.offsets[0][0]); 2]; PAIRS];
        for pair in 0..PAIRS {
            found[pair] = [read(self.offsets[pair][0]), read(self.offsets[pair][1])];
        }
        Some(found)
    }
}
