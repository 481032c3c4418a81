//! Gradient of the first layer's input: winners scattered, the affine part by a composite kernel.
//!
//! The affine part `kb + kc y` of `dy` is a convolution of the input. Convolving it back is one wider convolution with
//! `2 kernel - 1` steps and taxels and coefficients `sum_map kc w[i, j] w[i + d, j + e]` over the taps `(i, j)` that reach the output. The
//! coefficients depend on the output taxel and, near the ends, on the step. So there is one table for all inner steps and one for each
//! step near an end, each with a coefficient per taxel.

use rayon::prelude::*;

use super::padding::{ACROSS, MARGIN};
use super::winners::Winners;
use super::{FirstLayer, MAX_KERNEL};
use crate::norm::GradientAffine;
use crate::simd::{Narrow, NarrowKernel, Octet};

/// Number of zero rows around the sweep: the largest distance between two taps in time.
const REACH: usize = MAX_KERNEL[0] - 1;
/// Number of steps that are computed together.
const STEPS: usize = 4;

/// Coefficients of the affine part.
pub(crate) struct Composite {
    /// One table per range of kernel rows
    tables: Vec<Table>,
    /// Index of each step's table
    of_step: Vec<usize>,
}

struct Table {
    /// `[2 REACH + 1, ACROSS, lanes]`
    coefficients: Vec<f32>,
    /// `[lanes]`
    constant: Vec<f32>,
}

impl FirstLayer {
    /// Returns the tables for the weights and affine part of this training step.
    pub(crate) fn composite(&self, weight: &[f32], affine: &GradientAffine) -> Composite {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let (taps, pad) = (kernel_steps * kernel_taxels, self.shape.padding()[0]);
        let mut pairs = vec![0f64; taps * taps];
        let mut ones = vec![0f64; taps];
        for (map, weight) in weight.chunks_exact(taps).enumerate() {
            let (kb, kc) = (f64::from(affine.kb[map]), f64::from(affine.kc[map]));
            for (a, pairs) in pairs.chunks_exact_mut(taps).enumerate() {
                let scaled = kc * f64::from(weight[a]);
                pairs
                    .iter_mut()
                    .zip(weight)
                    .for_each(|(pair, &w)| *pair += scaled * f64::from(w));
                ones[a] += kb * f64::from(weight[a]);
            }
        }
        let mut ranges: Vec<(usize, usize)> = Vec::new();
        let mut of_step = Vec::with_capacity(self.shape.steps);
        for step in 0..self.shape.steps {
            // Tap row i belongs to output step `step + pad - i`.
            let range = (
                (step + pad + 1).saturating_sub(self.shape.steps),
                (step + pad + 1).min(kernel_steps),
            );
            let known = ranges.iter().position(|&r| r == range);
            of_step.push(known.unwrap_or(ranges.len()));
            if known.is_none() {
                ranges.push(range);
            }
        }
        let tables = ranges
            .into_par_iter()
            .map(|(first, end)| self.table(first..end, &pairs, &ones))
            .collect();
        Composite { tables, of_step }
    }

    fn table(&self, rows: std::ops::Range<usize>, pairs: &[f64], ones: &[f64]) -> Table {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let (taps, taxels, pad) = (
            kernel_steps * kernel_taxels,
            self.shape.taxels,
            self.shape.padding()[1],
        );
        let lanes = self.lanes();
        let mut table = Table {
            coefficients: vec![0.0; (2 * REACH + 1) * ACROSS * lanes],
            constant: vec![0.0; lanes],
        };
        for i in rows {
            for j in 0..kernel_taxels {
                // Output taxel `taxel + pad - j` must exist.
                let met =
                    j.saturating_sub(pad).min(taxels)..(taxels + j).saturating_sub(pad).min(taxels);
                met.clone()
                    .for_each(|taxel| table.constant[taxel] += ones[i * kernel_taxels + j] as f32);
                for other in 0..taps {
                    let (down, across) = (
                        other / kernel_taxels + REACH - i,
                        other % kernel_taxels + MARGIN - j,
                    );
                    let value = pairs[(i * kernel_taxels + j) * taps + other] as f32;
                    let row = &mut table.coefficients[(down * ACROSS + across) * lanes..][..lanes];
                    row[met.clone()]
                        .iter_mut()
                        .for_each(|coefficient| *coefficient += value);
                }
            }
        }
        table
    }

    /// Overwrites `out` with one sweep's input gradient, `[steps, taxels]`.
    pub(crate) fn input_gradient(
        &self,
        composite: &Composite,
        weight: &[f32],
        padded: &[f32],
        winners: &Winners,
        out: &mut [f32],
    ) {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let (steps, taxels, pad) = (self.shape.steps, self.shape.taxels, self.shape.padding()[0]);
        let row = self.row();
        // The sweep with REACH zero rows on either side.
        let mut wide = vec![0f32; (steps + 2 * REACH + STEPS) * row];
        wide[REACH * row..(REACH + steps) * row]
            .copy_from_slice(&padded[pad * row..(pad + steps) * row]);
        let mut kernels = vec![0f32; self.shape.maps_out * MAX_KERNEL[0] * 8];
        for (kernel, weight) in kernels
            .chunks_exact_mut(MAX_KERNEL[0] * 8)
            .zip(weight.chunks_exact(kernel_steps * kernel_taxels))
        {
            for (row, weight) in kernel
                .chunks_exact_mut(8)
                .zip(weight.chunks_exact(kernel_taxels))
            {
                row[..kernel_taxels].copy_from_slice(weight);
            }
        }
        let mut gradient = vec![0f32; padded.len()];
        let mut columns = self.buffers.take(padded.len() / row - 1);
        self.isa.run_narrow(Scatter {
            corner: self.corner(),
            row,
            kernels: &kernels,
            columns: &mut columns,
            winners,
            gradient: &mut gradient,
        });
        self.buffers.give(columns);
        self.isa.run_narrow(Convolve {
            composite,
            row,
            wide: &wide,
            gradient: &mut gradient[pad * row..(pad + steps) * row],
        });
        let rows = gradient.chunks_exact(row).skip(pad);
        for (out, row) in out.chunks_exact_mut(taxels).zip(rows) {
            out.copy_from_slice(&row[MARGIN..MARGIN + taxels]);
        }
    }
}

/// Addition of `gradient * kernel` around every winner.
struct Scatter<'a> {
    corner: usize,
    /// Number of values in a padded row.
    row: usize,
    kernels: &'a [f32],
    /// `[rows of the padded sweep]`: eight columns around one taxel
    columns: &'a mut [Octet],
    winners: &'a Winners,
    gradient: &'a mut [f32],
}

impl NarrowKernel for Scatter<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Narrow>(self) {
        for (taxel, winners) in self.winners.by_taxel().enumerate() {
            self.columns.fill(Octet::ZERO);
            for (winners, kernel) in winners.zip(self.kernels.chunks_exact(MAX_KERNEL[0] * 8)) {
                let (kernel, _) = kernel.as_chunks::<8>();
                let mut rows = [L::splat(0.0); MAX_KERNEL[0]];
                for row in 0..MAX_KERNEL[0] {
                    rows[row] = L::load_slice(&kernel[row]);
                }
                for winner in winners {
                    let columns = &mut self.columns[winner.row as usize..];
                    let Some(patch) = columns.first_chunk_mut::<{ MAX_KERNEL[0] }>() else {
                        continue;
                    };
                    let gradient = L::splat(winner.gradient);
                    for row in 0..MAX_KERNEL[0] {
                        let sum = gradient.mul_add(rows[row], L::load(patch, row));
                        sum.store(patch, row);
                    }
                }
            }
            let rows = self.gradient[self.corner + taxel..].chunks_mut(self.row);
            for (row, columns) in rows.zip(self.columns.iter()) {
                if let Some(values) = row.first_chunk_mut::<8>() {
                    let columns = L::load_slice(&columns.0);
                    columns.add(L::load_slice(values)).store_slice(values);
                }
            }
        }
    }
}

/// Addition of the affine part.
struct Convolve<'a> {
    composite: &'a Composite,
    /// Number of values in a padded row.
    row: usize,
    wide: &'a [f32],
    gradient: &'a mut [f32],
}

impl NarrowKernel for Convolve<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Narrow>(self) {
        // The most frequent width is a compile-time constant.
        match self.row - 2 * MARGIN {
            16 => self.of_width::<L, 16>(),
            _ => self.of_width::<L, 0>(),
        }
    }
}

impl Convolve<'_> {
    /// Runs for rows of `LANES` taxels; 0 stands for any number.
    #[inline(always)]
    fn of_width<L: Narrow, const LANES: usize>(self) {
        let of_step = &self.composite.of_step;
        let lanes = if LANES > 0 {
            LANES
        } else {
            self.row - 2 * MARGIN
        };
        let mut step = 0;
        while step < of_step.len() {
            // Four steps at once if they share a table.
            let together = of_step[step..].len() >= STEPS
                && of_step[step..step + STEPS]
                    .iter()
                    .all(|&t| t == of_step[step]);
            let table = &self.composite.tables[of_step[step]];
            for half in (0..lanes).step_by(8) {
                if together {
                    convolve::<L, STEPS, LANES>(table, self.wide, lanes, step, half, self.gradient);
                } else {
                    convolve::<L, 1, LANES>(table, self.wide, lanes, step, half, self.gradient);
                }
            }
            step += if together { STEPS } else { 1 };
        }
    }
}

/// Adds the convolution at `COUNT` steps from `step` on, for eight taxels from `half` on, to `gradient`.
#[inline(always)]
fn convolve<L: Narrow, const COUNT: usize, const LANES: usize>(
    table: &Table,
    wide: &[f32],
    lanes: usize,
    step: usize,
    half: usize,
    gradient: &mut [f32],
) {
    let lanes = if LANES > 0 { LANES } else { lanes };
    let row = lanes + 2 * MARGIN;
    let mut sums = [[L::splat(0.0); 2]; COUNT];
    for (down, coefficients) in table.coefficients.chunks_exact(ACROSS * lanes).enumerate() {
        let rows = &wide[(step + down) * row + half..][..(COUNT - 1) * row + 2 * MARGIN + 8];
        for across in 0..ACROSS {
            let Some(coefficient) = coefficients[across * lanes + half..].first_chunk::<8>() else {
                continue;
            };
            let coefficient = L::load_slice(coefficient);
            for index in 0..COUNT {
                let Some(x) = rows[index * row + across..].first_chunk::<8>() else {
                    continue;
                };
                sums[index][across % 2] =
                    L::load_slice(x).mul_add(coefficient, sums[index][across % 2]);
            }
        }
    }
    let constant = table.constant[half..]
        .first_chunk::<8>()
        .map_or(L::splat(0.0), L::load_slice);
    for index in 0..COUNT {
        if let Some(out) = gradient[(step + index) * row + MARGIN + half..].first_chunk_mut::<8>() {
            let sum = sums[index][0].add(sums[index][1]).add(constant);
            sum.add(L::load_slice(out)).store_slice(out);
        }
    }
}
