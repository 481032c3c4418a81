//! Gradient of the first layer's weights, from the winners and the input's autocorrelation.
//!
//! With `dy = ka g + kb + kc y` (see [`crate::norm`]) the gradient of tap `k` of a map with weights `w` is
//!
//! `sum ka g x[winner + k] + kb P[k] + kc (R w)[k]`, `P[k] = sum x[p + k]`, `R[k', k] = sum x[p + k'] x[p + k]`,
//!
//! where the first sum is over winners and the others over all output cells `p`. So the maps `y` are not needed. Except for the borders,
//! `R` depends only on the distance between the two taps: products of rows `a` and `a + d` are summed over all `a`, and the few rows that a
//! tap does not reach are subtracted.

use rayon::prelude::*;

use super::autocorrelation::Autocorrelation;
use super::shares::{Share, Total};
use super::winners::Gather;
use super::{FirstLayer, MAX_KERNEL, SavedFirstLayer};
use crate::norm::OutputGradient;
use crate::spare;

/// Maximum number of values in the partial sums kept at once, unless one sweep per thread needs more.
const MAX_SHARED: usize = 1 << 24;
/// Approximate number of steps that are summed in single precision; shorter sweeps share their sums.
const SUMMED_STEPS: usize = 1000;
/// Minimum number of partial sums per batch, for threads to share.
const MIN_SHARES: usize = 8;

impl FirstLayer {
    /// Returns the gradients of the weights and, if requested, of the input.
    pub(crate) fn backward(
        &self,
        saved: SavedFirstLayer,
        output: OutputGradient<'_>,
        need_input: bool,
    ) -> (Vec<f32>, Option<Vec<f32>>) {
        let shape = &self.shape;
        let edges = self.edges();
        let composite = need_input.then(|| self.composite(&saved.weight, output.affine));
        let values = shape.steps * shape.taxels;
        let mut d_input = need_input.then(|| spare::take(saved.input.len()));
        let mut targets: Vec<&mut [f32]> = match &mut d_input {
            Some(d_input) => d_input.chunks_exact_mut(values).collect(),
            None => (0..shape.batch).map(|_| <&mut [f32]>::default()).collect(),
        };
        let mut total = Total::new(self, edges.len());
        let of_share = (SUMMED_STEPS / shape.steps).clamp(1, shape.batch.div_ceil(MIN_SHARES));
        let together =
            (MAX_SHARED / total.products.len()).max(rayon::current_num_threads()) * of_share;
        for (part, targets) in targets.chunks_mut(together).enumerate() {
            let first = part * together;
            let shares: Vec<Share> = saved.input[first * values..][..targets.len() * values]
                .par_chunks(of_share * values)
                .zip(targets.par_chunks_mut(of_share))
                .enumerate()
                .map(|(at, (inputs, targets))| {
                    let mut share = total.empty_share();
                    let sweeps = first + at * of_share..;
                    let padded: Vec<Vec<f32>> = inputs
                        .chunks_exact(values)
                        .map(|input| self.pad(input))
                        .collect();
                    let rows = padded.first().map_or(0, Vec::len) / self.row();
                    let mut columns = self.buffers.take(rows.saturating_sub(1));
                    for ((padded, target), sweep) in padded.iter().zip(targets).zip(sweeps) {
                        let winners = self.winners(sweep, output);
                        self.isa.run_narrow(Gather {
                            corner: self.corner(),
                            row: self.row(),
                            padded,
                            columns: &mut columns,
                            winners: &winners,
                            out: &mut share.sparse,
                        });
                        if let Some(composite) = &composite {
                            self.input_gradient(composite, &saved.weight, padded, &winners, target);
                        }
                        self.winners.give(winners.all);
                    }
                    self.buffers.give(columns);
                    self.isa.run_narrow(Autocorrelation {
                        plan: self,
                        sweeps: &padded,
                        edges: &edges,
                        share: &mut share,
                    });
                    share
                })
                .collect();
            total.add(&shares);
        }
        let weight = self.weight_gradient(&saved.weight, output, &total, edges.len());
        spare::give(saved.input);
        (weight, d_input)
    }

    fn weight_gradient(
        &self,
        weight: &[f32],
        output: OutputGradient<'_>,
        total: &Total,
        edges: usize,
    ) -> Vec<f32> {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let taps = kernel_steps * kernel_taxels;
        let sparse = &total.sparse;
        let correlation = self.correlation(&total.products, edges);
        let patch_sums = self.patch_sums(&total.sums);
        let mut out = vec![0f32; weight.len()];
        let maps = out.par_chunks_exact_mut(taps);
        let maps = maps.zip(weight.par_chunks_exact(taps)).enumerate();
        maps.for_each(|(map, (out, weight))| {
            let (kb, kc) = (
                f64::from(output.affine.kb[map]),
                f64::from(output.affine.kc[map]),
            );
            for (tap, out) in out.iter_mut().enumerate() {
                let gathered =
                    sparse[(map * MAX_KERNEL[0] + tap / kernel_taxels) * 8 + tap % kernel_taxels];
                let row = &correlation[tap * taps..(tap + 1) * taps];
                let mixed: f64 = row.iter().zip(weight).map(|(r, &w)| r * f64::from(w)).sum();
                *out = (gathered + kb * patch_sums[tap] + kc * mixed) as f32;
            }
        });
        out
    }

    /// Returns `P` for each tap.
    fn patch_sums(&self, sums: &[f64]) -> Vec<f64> {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let (edges, lanes) = (self.edges(), self.lanes());
        let mut out = Vec::with_capacity(kernel_steps * kernel_taxels);
        for tap in 0..kernel_steps * kernel_taxels {
            let (row, column) = (tap / kernel_taxels, tap % kernel_taxels);
            let over = |line: usize| {
                self.met_taxels(column)
                    .map(|c| sums[line * lanes + c])
                    .sum::<f64>()
            };
            let missed = edges
                .iter()
                .enumerate()
                .filter(|&(_, &a)| !self.meets(row, a));
            out.push(over(0) - missed.map(|(edge, _)| over(1 + edge)).sum::<f64>());
        }
        out
    }

    /// Returns `R`, `[tap, tap]`.
    fn correlation(&self, products: &[f64], edges: usize) -> Vec<f64> {
        let [kernel_steps, kernel_taxels] = self.shape.kernel;
        let taps = kernel_steps * kernel_taxels;
        let (rows, columns) = (self.edges(), kernel_taxels * kernel_taxels);
        let mut out = vec![0f64; taps * taps];
        // Only pairs with the upper tap first are computed; the matrix is symmetric.
        out.par_chunks_exact_mut(taps)
            .enumerate()
            .for_each(|(tap, out)| {
                let (early, left) = (tap / kernel_taxels, tap % kernel_taxels);
                for late in early..kernel_steps {
                    let lines = &products[(late - early) * (1 + edges) * columns..];
                    for right in 0..kernel_taxels {
                        let over =
                            |line: usize| lines[line * columns + left * kernel_taxels + right];
                        let missed = rows
                            .iter()
                            .enumerate()
                            .filter(|&(_, &a)| !self.meets(early, a));
                        out[late * kernel_taxels + right] =
                            over(0) - missed.map(|(edge, _)| over(1 + edge)).sum::<f64>();
                    }
                }
            });
        for a in 0..taps {
            for b in 0..a {
                out[a * taps + b] = out[b * taps + a];
            }
        }
        out
    }
}
