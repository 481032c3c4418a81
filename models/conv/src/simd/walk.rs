//! Strided reads whose bounds are checked once.

use std::marker::PhantomData;

use super::{Lanes, Octet};

/// A walk through a slice in equal strides that yields `PAIRS` pairs of values at fixed offsets from each stop.
///
/// The bounds are checked once, when the walk is made: this keeps inner loops free of checks.
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
    /// Values that one read spans.
    const SPAN: usize;
    /// # Safety
    /// `SPAN` values can be read.
    unsafe fn read(from: *const Self) -> Self::Read;
}

/// Plain values are read as they are.
impl<L> Stop<L> for f32 {
    type Read = f32;
    const SPAN: usize = 1;
    #[inline(always)]
    unsafe fn read(from: *const f32) -> f32 {
        // SAFETY: the caller grants one value.
        unsafe { *from }
    }
}

/// Octets are read as vectors.
impl<L: Lanes> Stop<L> for Octet {
    type Read = L;
    const SPAN: usize = L::OCTETS;
    #[inline(always)]
    unsafe fn read(from: *const Octet) -> L {
        // SAFETY: the caller grants the octets of a vector.
        unsafe { L::load_from(from.cast()) }
    }
}

impl<'a, L, T: Stop<L>, const PAIRS: usize> Walk<'a, T, L, PAIRS> {
    /// Panics unless every stop lies within `values`.
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

    /// The values at the next stop.
    #[inline(always)]
    pub(crate) fn step(&mut self) -> Option<[[T::Read; 2]; PAIRS]> {
        if self.at == self.end {
            return None;
        }
        let at = self.at;
        self.at += self.stride;
        // SAFETY: `at` is one of the stops whose furthest read `new` has checked.
        let read = |offset: usize| unsafe { T::read(self.values.as_ptr().add(at + offset)) };
        let mut found = [[read(self.offsets[0][0]); 2]; PAIRS];
        for pair in 0..PAIRS {
            found[pair] = [read(self.offsets[pair][0]), read(self.offsets[pair][1])];
        }
        Some(found)
    }
}
