//! Sweeps of the first layer padded with zeros, and the taps that reach their rows.

use std::ops::Range;

use super::{FirstLayer, MAX_KERNEL};

/// Number of zeros before the first taxel: the largest distance between two taps of a row.
pub(crate) const MARGIN: usize = MAX_KERNEL[1] - 1;
/// Number of distances between two taps of a row, from `-MARGIN` to `MARGIN`.
pub(crate) const ACROSS: usize = 2 * MARGIN + 1;

impl FirstLayer {
    /// Returns the sweep padded with zeros: `pad` rows before it, and enough rows after it for a patch.
    pub(crate) fn pad(&self, input: &[f32]) -> Vec<f32> {
        let (taxels, pad) = (self.shape.taxels, self.shape.padding()[0]);
        let row = self.row();
        let mut padded = vec![0.0; (self.shape.steps + pad + MAX_KERNEL[0] + 1) * row];
        for (row, values) in padded
            .chunks_exact_mut(row)
            .skip(pad)
            .zip(input.chunks_exact(taxels))
        {
            row[MARGIN..MARGIN + taxels].copy_from_slice(values);
        }
        padded
    }

    /// Returns the number of taxels rounded up to whole octets.
    pub(crate) fn lanes(&self) -> usize {
        self.shape.taxels.next_multiple_of(8)
    }

    /// Returns the number of values in a padded row: four zeros, the taxels, zeros.
    pub(crate) fn row(&self) -> usize {
        self.lanes() + 2 * MARGIN
    }

    /// Returns the offset of the first taxel's patches in their rows.
    pub(crate) fn corner(&self) -> usize {
        MARGIN - self.shape.padding()[1]
    }

    /// Returns the padded rows of the sweep that some tap does not reach.
    pub(crate) fn edges(&self) -> Vec<usize> {
        let (steps, pad) = (self.shape.steps, self.shape.padding()[0]);
        (0..2 * pad + steps)
            .filter(|&a| (pad..pad + steps).contains(&a) && (a < 2 * pad || a >= steps))
            .collect()
    }

    /// Returns true if tap row `tap` reads padded row `a` for some output step.
    pub(crate) fn meets(&self, tap: usize, a: usize) -> bool {
        (tap..tap + self.shape.steps).contains(&a)
    }

    /// Returns the taxels that tap column `tap` reads.
    pub(crate) fn met_taxels(&self, tap: usize) -> Range<usize> {
        let (taxels, pad) = (self.shape.taxels, self.shape.padding()[1]);
        tap.saturating_sub(pad)..(taxels + tap).saturating_sub(pad).min(taxels)
    }
}
