//! Rows of a buffer, picked by a table, that transforms read and write; their bounds are checked once.

use std::marker::PhantomData;

use super::{Lanes, Octet};

/// A row that reads as zero, or is not wanted.
pub(in crate::conv) const NOWHERE: u32 = u32::MAX;

/// Which row of a buffer each element of a transform lies in; [`NOWHERE`] is allowed.
#[derive(Debug, Clone)]
pub(in crate::conv) struct Table {
    rows: Vec<u32>,
    furthest: usize,
}

impl Table {
    /// Keeps the rows and notes the furthest.
    pub(in crate::conv) fn new(rows: impl Iterator<Item = u32>) -> Self {
        let rows: Vec<u32> = rows.collect();
        let furthest = rows
            .iter()
            .filter(|&&row| row != NOWHERE)
            .max()
            .map_or(0, |&row| row as usize);
        Self { rows, furthest }
    }

    /// Row of every element.
    pub(in crate::conv) fn rows(&self) -> &[u32] {
        &self.rows
    }
}

/// Where a transform reads or writes: element `t` has its real part at `table[t] * stride + parts[0]`.
#[derive(Debug, Clone, Copy)]
pub(in crate::conv) struct Rows<'a> {
    pub(in crate::conv) table: &'a Table,
    pub(in crate::conv) stride: usize,
    pub(in crate::conv) parts: [usize; 2],
}

impl<'a> Rows<'a> {
    /// Real and imaginary parts exchanged: a forward transform between such rows is an inverse one.
    pub(in crate::conv) fn exchanged(self) -> Self {
        Self {
            parts: [self.parts[1], self.parts[0]],
            ..self
        }
    }

    /// Panics unless every row lies within `len` octets with all the octets of a vector; past this, rows are reached unchecked.
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

/// Rows to read from.
#[derive(Debug, Clone, Copy)]
pub(in crate::conv) struct Reader<'a, L> {
    values: &'a [Octet],
    rows: Rows<'a>,
    lanes: PhantomData<L>,
}

impl<'a, L: Lanes> Reader<'a, L> {
    /// Panics unless every row lies within `values`.
    #[inline(always)]
    pub(in crate::conv) fn new(values: &'a [Octet], rows: Rows<'a>) -> Self {
        rows.check::<L>(values.len());
        Self {
            values,
            rows,
            lanes: PhantomData,
        }
    }

    /// Real and imaginary part of an element, zero if it lies nowhere.
    #[inline(always)]
    pub(in crate::conv) fn read(&self, element: usize) -> [L; 2] {
        let row = self.rows.table.rows[element];
        if row == NOWHERE {
            return [L::splat(0.0); 2];
        }
        let at = row as usize * self.rows.stride;
        let [re, im] = self.rows.parts;
        let first = self.values.as_ptr();
        // SAFETY: `new` has checked the furthest row with both parts, for vectors of this width.
        unsafe {
            [
                L::load_from(first.add(at + re).cast()),
                L::load_from(first.add(at + im).cast()),
            ]
        }
    }
}

/// Rows to write to.
#[derive(Debug)]
pub(in crate::conv) struct Writer<'a, L> {
    values: &'a mut [Octet],
    rows: Rows<'a>,
    lanes: PhantomData<L>,
}

impl<'a, L: Lanes> Writer<'a, L> {
    /// Panics unless every row lies within `values`.
    #[inline(always)]
    pub(in crate::conv) fn new(values: &'a mut [Octet], rows: Rows<'a>) -> Self {
        rows.check::<L>(values.len());
        Self {
            values,
            rows,
            lanes: PhantomData,
        }
    }

    /// Stores real and imaginary part of an element, unless it lies nowhere.
    #[inline(always)]
    pub(in crate::conv) fn write(&mut self, element: usize, [re, im]: [L; 2]) {
        let row = self.rows.table.rows[element];
        if row != NOWHERE {
            let at = row as usize * self.rows.stride;
            let parts = self.rows.parts;
            let first = self.values.as_mut_ptr();
            // SAFETY: `new` has checked the furthest row with both parts, for vectors of this width.
            unsafe {
                re.store_to(first.add(at + parts[0]).cast());
                im.store_to(first.add(at + parts[1]).cast());
            }
        }
    }
}
