//! Autocorrelation of the first layer's input: products of any two rows up to a kernel apart.

use std::ops::Range;

use super::FirstLayer;
use super::padding::{ACROSS, MARGIN};
use super::shares::Share;
use crate::simd::{Narrow, NarrowKernel};

/// Computation of the products of any two rows up to a kernel apart, summed over all rows and over each edge row, and of column sums.
pub(crate) struct Autocorrelation<'a> {
    pub(crate) plan: &'a FirstLayer,
    /// Padded sweeps
    pub(crate) sweeps: &'a [Vec<f32>],
    pub(crate) edges: &'a [usize],
    pub(crate) share: &'a mut Share,
}

/// Sums the products of padded `rows` with the rows `distance` later, `[ACROSS, lanes]`.
#[inline(always)]
fn multiply_rows<L: Narrow>(
    plan: &FirstLayer,
    sweeps: &[Vec<f32>],
    rows: Range<usize>,
    distance: usize,
    out: &mut [f32],
) {
    let (row, lanes) = (plan.row(), plan.lanes());
    for half in (0..lanes).step_by(8) {
        let mut sums = [L::splat(0.0); ACROSS];
        for padded in sweeps {
            for a in rows.clone() {
                let base = &padded[a * row + MARGIN + half..];
                let other = &padded[(a + distance) * row + half..];
                let (Some(x), Some(other)) = (
                    base.first_chunk::<8>(),
                    other.first_chunk::<{ 2 * MARGIN + 8 }>(),
                ) else {
                    continue;
                };
                let x = L::load_slice(x);
                for across in 0..ACROSS {
                    let Some(values) = other[across..].first_chunk::<8>() else {
                        continue;
                    };
                    sums[across] = x.mul_add(L::load_slice(values), sums[across]);
                }
            }
        }
        for across in 0..ACROSS {
            if let Some(out) = out[across * lanes + half..].first_chunk_mut::<8>() {
                sums[across].store_slice(out);
            }
        }
    }
}

impl NarrowKernel for Autocorrelation<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Narrow>(self) {
        let (steps, pad) = (self.plan.shape.steps, self.plan.shape.padding()[0]);
        let (row, lanes) = (self.plan.row(), self.plan.lanes());
        let Share { products, sums, .. } = self.share;
        let (lines, columns) = (1 + self.edges.len(), self.plan.shape.kernel[1].pow(2));
        let mut by_taxel = vec![0.0; ACROSS * lanes];
        for (distance, out) in products.chunks_exact_mut(lines * columns).enumerate() {
            for (line, out) in out.chunks_exact_mut(columns).enumerate() {
                let rows = match line {
                    0 => pad..pad + steps,
                    _ => self.edges[line - 1]..self.edges[line - 1] + 1,
                };
                // Of the first rows, only those that a later tap skips are needed; the last rows meet zeros at this distance.
                let later_tap = rows.start + 1 + distance < self.plan.shape.kernel[0];
                let below = rows.start >= steps && rows.start + distance < pad + steps;
                if line > 0 && !later_tap && !below {
                    continue;
                }
                multiply_rows::<L>(self.plan, self.sweeps, rows, distance, &mut by_taxel);
                self.plan.by_columns(&by_taxel, out);
            }
        }
        for (line, out) in sums.chunks_exact_mut(lanes).enumerate() {
            let rows = match line {
                0 => pad..pad + steps,
                _ => self.edges[line - 1]..self.edges[line - 1] + 1,
            };
            for padded in self.sweeps {
                for a in rows.clone() {
                    for (out, &x) in out.iter_mut().zip(&padded[a * row + MARGIN..]) {
                        *out += x;
                    }
                }
            }
        }
    }
}

impl FirstLayer {
    /// Sums the products of two tap columns, `[left, right]`, from the products of every taxel with its neighbours, `[ACROSS, lanes]`.
    ///
    /// Tap columns before the middle do not read the last taxels, those after it do not read the first.
    fn by_columns(&self, by_taxel: &[f32], out: &mut [f64]) {
        let (lanes, width) = (self.lanes(), self.shape.kernel[1]);
        let mut all = [0f64; ACROSS];
        for (all, line) in all.iter_mut().zip(by_taxel.chunks_exact(lanes)) {
            *all = sum(&line[..self.shape.taxels]);
        }
        for left in 0..width {
            let met = self.met_taxels(left);
            for right in 0..width {
                let across = right + MARGIN - left;
                let line = &by_taxel[across * lanes..][..self.shape.taxels];
                let missed = line[..met.start].iter().chain(&line[met.end..]);
                out[left * width + right] =
                    missed.fold(all[across], |all, &value| all - f64::from(value));
            }
        }
    }
}

/// Returns the sum in double precision, accumulated in eight lanes.
fn sum(values: &[f32]) -> f64 {
    let (eights, rest) = values.as_chunks::<8>();
    let mut sums = [0f64; 8];
    for eight in eights {
        for (sum, &value) in sums.iter_mut().zip(eight) {
            *sum += f64::from(value);
        }
    }
    sums.iter().sum::<f64>() + rest.iter().map(|&value| f64::from(value)).sum::<f64>()
}
