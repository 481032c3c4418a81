//! Sources and targets of transforms: rows of a buffer, selected by a table, or a sequence of elements. Row bounds are checked once, element
//! bounds once per butterfly.

use std::marker::PhantomData;

use super::prefetch::{prefetch, prefetch_to_write};
use super::{Lanes, Octet};
use crate::butterfly::Complex;

/// Row number of an element that reads as zero or is not written.
pub(crate) const NOWHERE: u32 = u32::MAX;

/// Value of [`Rows::ahead`] that disables prefetching.
pub(crate) const NOTHING: usize = 0;
/// Value of [`Rows::ahead`] that prefetches the rows themselves before they are written.
pub(crate) const WRITTEN: usize = 1;

/// Row of the buffer for each element of a transform, or [`NOWHERE`].
#[derive(Debug, Clone)]
pub(crate) struct Table {
    rows: Vec<u32>,
    furthest: usize,
}

impl Table {
    /// Stores the rows and the largest row number.
    pub(crate) fn new(rows: impl Iterator<Item = u32>) -> Self {
        let rows: Vec<u32> = rows.collect();
        let furthest = rows
            .iter()
            .filter(|&&row| row != NOWHERE)
            .max()
            .map_or(0, |&row| row as usize);
        Self { rows, furthest }
    }

    /// Returns the row of every element.
    pub(crate) fn rows(&self) -> &[u32] {
        &self.rows
    }
}

/// Memory layout of a transform's input or output: the real part of element `t` is at `table[t] * stride + parts[0]`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows<'a> {
    pub(crate) table: &'a Table,
    pub(crate) stride: usize,
    pub(crate) parts: [usize; 2],
    /// Prefetching: [`NOTHING`]; the distance in octets for rows that are read; [`WRITTEN`] for rows that are written.
    pub(crate) ahead: usize,
}

impl<'a> Rows<'a> {
    /// Returns the rows with real and imaginary parts exchanged, which turns a forward transform into an inverse one.
    pub(crate) fn exchanged(self) -> Self {
        Self {
            parts: [self.parts[1], self.parts[0]],
            ..self
        }
    }

    /// Panics unless every row, with a whole vector, is within `len` octets; later accesses are unchecked.
    #[inline(always)]
    fn check<L: Lanes>(&self, len: usize) {
        let part = self.parts[0].max(self.parts[1]);
        let furthest = self
            .table
            .furthest
            .checked_mul(self.stride)
            .and_then(|at| at.checked_add(part + L::OCTETS - 1));
        assert!(
            furthest.is_some_and(|at| at < len),
            "every row lies within its buffer"
        );
    }
}

/// Unrolls a block for k = 0, 1, … so that values stay in registers; loops are not always unrolled, and closures not always inlined.
macro_rules! unrolled {
    ($k:ident < $n:ident => $body:block) => {
        $crate::simd::unrolled!(@ $k $n $body 0 1 2 3 4 5 6 7 8 9 10 11)
    };
    (@ $k:ident $n:ident $body:block $($value:literal)*) => {
        $(if $value < $n {
            let $k = $value;
            $body
        })*
    };
}
pub(crate) use unrolled;

/// Panics unless the table has `count` elements from `first` on, `apart` from each other.
#[inline(always)]
fn check_elements(rows: &[u32], first: usize, apart: usize, count: usize) {
    assert!(
        first + apart * (count - 1) < rows.len(),
        "every element has a row"
    );
}

/// Reads from rows; an element at [`NOWHERE`] reads as zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Reader<'a, L> {
    rows: &'a [u32],
    /// Pointers to the real and imaginary part of row 0.
    parts: [*const Octet; 2],
    stride: usize,
    ahead: usize,
    lanes: PhantomData<(&'a [Octet], L)>,
}

impl<'a, L: Lanes> Reader<'a, L> {
    /// Panics unless every row is within `values`.
    #[inline(always)]
    pub(crate) fn new(values: &'a [Octet], rows: Rows<'a>) -> Self {
        rows.check::<L>(values.len());
        Self {
            rows: &rows.table.rows,
            parts: rows.parts.map(|part| values.as_ptr().wrapping_add(part)),
            stride: rows.stride,
            ahead: rows.ahead,
            lanes: PhantomData,
        }
    }

    /// Reads `N` elements, `apart` from each other.
    #[inline(always)]
    pub(crate) fn read_every<const N: usize>(&self, first: usize, apart: usize) -> [Complex<L>; N] {
        check_elements(self.rows, first, apart, N);
        let [re, im] = self.parts;
        let mut found = [Complex::zero(); N];
        unrolled!(k < N => {
            // SAFETY: `check_elements` has checked the last of these indices.
            let row = unsafe { *self.rows.get_unchecked(first + apart * k) };
            if row != NOWHERE {
                let at = row as usize * self.stride;
                if self.ahead != NOTHING {
                    prefetch(re.wrapping_add(at + self.ahead));
                    prefetch(im.wrapping_add(at + self.ahead));
                }
                // SAFETY: `new` has checked the last row with both parts, for vectors of this width.
                found[k] = unsafe {
                    Complex {
                        re: L::load_from(re.add(at).cast()),
                        im: L::load_from(im.add(at).cast()),
                    }
                };
            }
        });
        found
    }
}

/// Writes to rows; an element at [`NOWHERE`] is dropped.
#[derive(Debug)]
pub(crate) struct Writer<'a, L> {
    rows: &'a [u32],
    /// Pointers to the real and imaginary part of row 0.
    parts: [*mut Octet; 2],
    stride: usize,
    lanes: PhantomData<(&'a mut [Octet], L)>,
}

impl<'a, L: Lanes> Writer<'a, L> {
    /// Panics unless every row is within `values`.
    #[inline(always)]
    pub(crate) fn new(values: &'a mut [Octet], rows: Rows<'a>) -> Self {
        rows.check::<L>(values.len());
        let first = values.as_mut_ptr();
        Self {
            rows: &rows.table.rows,
            parts: rows.parts.map(|part| first.wrapping_add(part)),
            stride: rows.stride,
            lanes: PhantomData,
        }
    }

    /// Prefetches the cache lines of `N` elements for writing.
    #[inline(always)]
    pub(crate) fn expect<const N: usize>(&self, first: usize) {
        check_elements(self.rows, first, 1, N);
        unrolled!(k < N => {
            // SAFETY: `check_elements` has checked the last of these indices.
            let row = unsafe { *self.rows.get_unchecked(first + k) };
            if row != NOWHERE {
                let at = row as usize * self.stride;
                prefetch_to_write(self.parts[0].wrapping_add(at));
                prefetch_to_write(self.parts[1].wrapping_add(at));
            }
        });
    }

    /// Stores `N` elements, `apart` from each other.
    #[inline(always)]
    pub(crate) fn write_every<const N: usize>(
        &mut self,
        first: usize,
        apart: usize,
        values: [Complex<L>; N],
    ) {
        check_elements(self.rows, first, apart, N);
        let parts = self.parts;
        unrolled!(k < N => {
            // SAFETY: `check_elements` has checked the last of these indices.
            let row = unsafe { *self.rows.get_unchecked(first + apart * k) };
            if row != NOWHERE {
                let at = row as usize * self.stride;
                // SAFETY: `new` has checked the last row with both parts, for vectors of this width.
                unsafe {
                    values[k].re.store_to(parts[0].add(at).cast());
                    values[k].im.store_to(parts[1].add(at).cast());
                }
            }
        });
    }
}

/// Consecutive elements between two passes, each a vector of real and one of imaginary parts.
#[derive(Debug)]
pub(crate) struct Sequence<V, L> {
    elements: V,
    lanes: PhantomData<L>,
}

impl<V, L: Lanes> Sequence<V, L> {
    pub(crate) fn new(elements: V) -> Self {
        Self {
            elements,
            lanes: PhantomData,
        }
    }
}

/// Panics unless `count` elements from `first` on, `apart` from each other, are within a sequence of `len` octets.
#[inline(always)]
fn check_sequence<L: Lanes>(len: usize, first: usize, apart: usize, count: usize) {
    assert!(
        (first + apart * (count - 1) + 1) * 2 * L::OCTETS <= len,
        "every element lies within the sequence"
    );
}

impl<L: Lanes> Sequence<&[Octet], L> {
    /// Reads `N` elements, `apart` from each other.
    #[inline(always)]
    pub(crate) fn read_every<const N: usize>(&self, first: usize, apart: usize) -> [Complex<L>; N] {
        check_sequence::<L>(self.elements.len(), first, apart, N);
        let from = self.elements.as_ptr();
        let mut found = [Complex::zero(); N];
        unrolled!(k < N => {
            // SAFETY: `check_sequence` has checked the last of these elements.
            found[k] = unsafe {
                let at = from.add((first + apart * k) * 2 * L::OCTETS);
                Complex {
                    re: L::load_from(at.cast()),
                    im: L::load_from(at.add(L::OCTETS).cast()),
                }
            };
        });
        found
    }
}

impl<L: Lanes> Sequence<&mut [Octet], L> {
    /// Stores `N` elements, `apart` from each other.
    #[inline(always)]
    pub(crate) fn write_every<const N: usize>(
        &mut self,
        first: usize,
        apart: usize,
        values: [Complex<L>; N],
    ) {
        check_sequence::<L>(self.elements.len(), first, apart, N);
        let to = self.elements.as_mut_ptr();
        unrolled!(k < N => {
            // SAFETY: `check_sequence` has checked the last of these elements.
            unsafe {
                let at = to.add((first + apart * k) * 2 * L::OCTETS);
                values[k].re.store_to(at.cast());
                values[k].im.store_to(at.add(L::OCTETS).cast());
            }
        });
    }
}
