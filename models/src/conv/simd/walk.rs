//! Strided reads whose bounds are checked once.

/// A walk through a slice in equal strides that yields `PAIRS` pairs of values at fixed offsets from each stop.
///
/// The bounds are checked once, when the walk is made: this keeps inner loops free of checks.
#[derive(Debug, Clone)]
pub(in crate::conv) struct Walk<'a, T, const PAIRS: usize> {
    values: &'a [T],
    stride: usize,
    offsets: [[usize; 2]; PAIRS],
    at: usize,
    end: usize,
}

impl<'a, T, const PAIRS: usize> Walk<'a, T, PAIRS> {
    /// Panics unless every stop lies within `values`.
    #[inline(always)]
    pub(in crate::conv) fn new(
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
                .and_then(|at| at.checked_add(furthest))
                .is_some_and(|at| at < values.len()),
            None => true,
        };
        assert!(inside && stride > 0, "a walk stays within its slice");
        Self {
            values,
            stride,
            offsets,
            at: 0,
            end: stops * stride,
        }
    }
}

impl<'a, T, const PAIRS: usize> Walk<'a, T, PAIRS> {
    /// The values at the next stop.
    #[inline(always)]
    pub(in crate::conv) fn step(&mut self) -> Option<[[&'a T; 2]; PAIRS]> {
        if self.at == self.end {
            return None;
        }
        let at = self.at;
        self.at += self.stride;
        // SAFETY: `at` is one of the stops whose furthest read `new` has checked.
        let read = |offset: usize| unsafe { self.values.get_unchecked(at + offset) };
        let mut found = [[read(self.offsets[0][0]); 2]; PAIRS];
        for pair in 0..PAIRS {
            found[pair] = [read(self.offsets[pair][0]), read(self.offsets[pair][1])];
        }
        Some(found)
    }
}
