//! Gradient of the first layer's weights, from the winners and the input's autocorrelation.
//!
//! With `dy = ka g + kb + kc y` (see [`super::norm`]) the gradient of tap `k` of a map with weights `w` is
//!
//! `sum ka g x[winner + k] + kb P[k] + kc (R w)[k]`, `P[k] = sum x[p + k]`, `R[k', k] = sum x[p + k'] x[p + k]`,
//!
//! where the first sum is over winners and the others over all output cells `p`. So the maps `y` are not needed. Except for the borders,
//! `R` depends only on the distance between the two taps: products of rows `a` and `a + d` are summed over all `a`, and the few rows that a
//! tap does not reach are subtracted.

use rayon::prelude::*;

use super::first_layer::{FirstLayer, MAX_KERNEL, SavedFirstLayer};
use super::norm::OutputGradient;
use super::simd::{Narrow, NarrowKernel, Octet};
use super::spare;

/// Number of zeros before the first taxel: the largest distance between two taps of a row.
pub(super) const MARGIN: usize = MAX_KERNEL[1] - 1;
/// Number of sums that a thread computes at once.
const RUN: usize = 1 << 11;
/// Maximum number of values in the partial sums kept at once, unless one sweep per thread needs more.
const MAX_SHARED: usize = 1 << 24;
/// Approximate number of steps that are summed in single precision; shorter sweeps share their sums.
const SUMMED_STEPS: usize = 1000;
/// Minimum number of partial sums per batch, for threads to share.
const MIN_SHARES: usize = 8;
/// Number of distances between two taps of a row, from `-MARGIN` to `MARGIN`.
const ACROSS: usize = 2 * MARGIN + 1;

/// Winner with a gradient: the gradient times `ka`, and the padded row where its patch begins.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Winner {
    pub(super) gradient: f32,
    pub(super) row: u32,
}

/// Winners of one sweep with non-zero gradient, by taxel and map.
///
/// The patches of one taxel's winners lie in the same few columns of the sweep. These columns are copied, one octet per row, so that
/// patches are whole consecutive octets in the L1 cache.
pub(super) struct Winners {
    /// `[taxels, maps_out, pooled_steps]`; the first `counts` entries of each map are winners
    all: Vec<Winner>,
    /// `[taxels, maps_out]`
    counts: Vec<usize>,
    maps: usize,
}

impl Winners {
    /// Iterates over taxels and, for each, over the winners of every map.
    pub(super) fn by_taxel(&self) -> impl Iterator<Item = impl Iterator<Item = &[Winner]>> {
        let windows = self.all.len() / self.counts.len();
        let taxels = self.all.chunks_exact(windows * self.maps);
        taxels
            .zip(self.counts.chunks_exact(self.maps))
            .map(move |(winners, counts)| {
                let maps = winners.chunks_exact(windows).zip(counts);
                maps.map(|(winners, &count)| &winners[..count])
            })
    }
}

/// Partial sums over a few sweeps.
struct Share {
    /// `[maps_out, MAX_KERNEL[0], 8]`
    sparse: Vec<f32>,
    /// `[time distance, 1 + edges, kernel taxels, kernel taxels]`: products of two tap columns over all rows, and over each edge row
    products: Vec<f64>,
    /// `[1 + edges, lanes]`: column sums over all rows and over each edge row
    sums: Vec<f32>,
}

/// Total of all partial sums, added in order.
struct Total {
    sparse: Vec<f64>,
    products: Vec<f64>,
    sums: Vec<f64>,
}

impl Total {
    fn add(&mut self, shares: &[Share]) {
        add_all(&mut self.sparse, shares, |share| &share.sparse);
        add_all(&mut self.products, shares, |share| &share.products);
        add_all(&mut self.sums, shares, |share| &share.sums);
    }
}

fn add_all<T: Copy + Into<f64> + Sync>(
    total: &mut [f64],
    shares: &[Share],
    part: impl Fn(&Share) -> &[T] + Sync,
) {
    total
        .par_chunks_mut(RUN)
        .enumerate()
        .for_each(|(run, total)| {
            for share in shares {
                let values = &part(share)[run * RUN..][..total.len()];
                for (total, &value) in total.iter_mut().zip(values) {
                    *total += value.into();
                }
            }
        });
}

impl FirstLayer {
    /// Returns the gradients of the weights and, if requested, of the input.
    pub(super) fn backward(
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
        let lengths = [
            shape.maps_out * MAX_KERNEL[0] * 8,
            shape.kernel[0] * (1 + edges.len()) * shape.kernel[1] * shape.kernel[1],
            (1 + edges.len()) * self.lanes(),
        ];
        let [sparse, products, sums] = lengths.map(|len| vec![0f64; len]);
        let mut total = Total {
            sparse,
            products,
            sums,
        };
        let of_share = (SUMMED_STEPS / shape.steps).clamp(1, shape.batch.div_ceil(MIN_SHARES));
        let together = (MAX_SHARED / lengths[1]).max(rayon::current_num_threads()) * of_share;
        for (part, targets) in targets.chunks_mut(together).enumerate() {
            let first = part * together;
            let inputs = saved.input[first * values..][..targets.len() * values]
                .par_chunks(of_share * values);
            let share = |(at, (inputs, targets)): (usize, (&[f32], &mut [&mut [f32]]))| {
                let padded: Vec<Vec<f32>> = inputs
                    .chunks_exact(values)
                    .map(|input| self.pad(input))
                    .collect();
                let mut share = Share {
                    sparse: vec![0.0; lengths[0]],
                    products: vec![0.0; lengths[1]],
                    sums: vec![0.0; lengths[2]],
                };
                let rows = padded.first().map_or(0, Vec::len) / self.row();
                let mut columns = self.buffers.take(rows.saturating_sub(1));
                let sweeps = padded.iter().zip(targets).zip(first + at * of_share..);
                for ((padded, target), sweep) in sweeps {
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
            };
            let shares: Vec<Share> = inputs
                .zip(targets.par_chunks_mut(of_share))
                .enumerate()
                .map(share)
                .collect();
            total.add(&shares);
        }
        let weight = self.weight_gradient(&saved.weight, output, &total, edges.len());
        spare::give(saved.input);
        (weight, d_input)
    }

    /// Returns the sweep padded with zeros: `pad` rows before it, and enough rows after it for a patch.
    fn pad(&self, input: &[f32]) -> Vec<f32> {
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
    pub(super) fn lanes(&self) -> usize {
        self.shape.taxels.next_multiple_of(8)
    }

    /// Returns the number of values in a padded row: four zeros, the taxels, zeros.
    pub(super) fn row(&self) -> usize {
        self.lanes() + 2 * MARGIN
    }

    /// Returns the offset of the first taxel's patches in their rows.
    pub(super) fn corner(&self) -> usize {
        MARGIN - self.shape.padding()[1]
    }

    fn winners(&self, sweep: usize, output: OutputGradient<'_>) -> Winners {
        let shape = &self.shape;
        let cells = shape.pooled_steps() * shape.taxels;
        let mut found = Winners {
            all: self.winners.take(shape.maps_out * cells),
            counts: vec![0; shape.taxels * shape.maps_out],
            maps: shape.maps_out,
        };
        let span = sweep * cells * shape.maps_out..(sweep + 1) * cells * shape.maps_out;
        let rows = output.gradient[span.clone()].chunks_exact(shape.maps_out);
        let windows = shape.pooled_steps();
        for (cell, (gradients, positions)) in rows
            .zip(output.positions[span].chunks_exact(shape.maps_out))
            .enumerate()
        {
            let (first, taxel) = (cell / shape.taxels * shape.pool, cell % shape.taxels);
            let maps = taxel * shape.maps_out..(taxel + 1) * shape.maps_out;
            let all = &mut found.all[maps.start * windows..maps.end * windows];
            let lists = all.chunks_exact_mut(windows).zip(&mut found.counts[maps]);
            for (((&gradient, &position), ka), (winners, count)) in gradients
                .iter()
                .zip(positions)
                .zip(&output.affine.ka)
                .zip(lists)
            {
                // Every winner is written, but counted only if its gradient is not zero. About half are zero, so a branch would be mispredicted.
                winners[*count] = Winner {
                    gradient: gradient * ka,
                    row: (first + usize::from(position)) as u32,
                };
                *count += usize::from(gradient != 0.0);
            }
        }
        found
    }

    /// Returns the padded rows of the sweep that some tap does not reach.
    fn edges(&self) -> Vec<usize> {
        let (steps, pad) = (self.shape.steps, self.shape.padding()[0]);
        (0..2 * pad + steps)
            .filter(|&a| (pad..pad + steps).contains(&a) && (a < 2 * pad || a >= steps))
            .collect()
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

    /// Returns true if tap row `tap` reads padded row `a` for some output step.
    fn meets(&self, tap: usize, a: usize) -> bool {
        (tap..tap + self.shape.steps).contains(&a)
    }

    /// Returns the taxels that tap column `tap` reads.
    fn met_taxels(&self, tap: usize) -> std::ops::Range<usize> {
        let (taxels, pad) = (self.shape.taxels, self.shape.padding()[1]);
        tap.saturating_sub(pad)..(taxels + tap).saturating_sub(pad).min(taxels)
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

/// Computation of the sums of `gradient * patch` for each map.
struct Gather<'a> {
    corner: usize,
    /// Number of values in a padded row.
    row: usize,
    padded: &'a [f32],
    /// `[rows of the padded sweep]`: eight columns around one taxel
    columns: &'a mut [Octet],
    winners: &'a Winners,
    out: &'a mut [f32],
}

impl NarrowKernel for Gather<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Narrow>(self) {
        for (taxel, winners) in self.winners.by_taxel().enumerate() {
            let rows = self.padded[self.corner + taxel..].chunks(self.row);
            for (row, columns) in rows.zip(self.columns.iter_mut()) {
                if let Some(values) = row.first_chunk::<8>() {
                    columns.0 = *values;
                }
            }
            for (winners, out) in winners.zip(self.out.chunks_exact_mut(MAX_KERNEL[0] * 8)) {
                let (out, _) = out.as_chunks_mut::<8>();
                let Some(out) = out.first_chunk_mut::<{ MAX_KERNEL[0] }>() else {
                    continue;
                };
                let mut sums = [L::splat(0.0); MAX_KERNEL[0]];
                for row in 0..MAX_KERNEL[0] {
                    sums[row] = L::load_slice(&out[row]);
                }
                for winner in winners {
                    let rows = &self.columns[winner.row as usize..];
                    let Some(patch) = rows.first_chunk::<{ MAX_KERNEL[0] }>() else {
                        continue;
                    };
                    let gradient = L::splat(winner.gradient);
                    for row in 0..MAX_KERNEL[0] {
                        sums[row] = gradient.mul_add(L::load(patch, row), sums[row]);
                    }
                }
                for row in 0..MAX_KERNEL[0] {
                    sums[row].store_slice(&mut out[row]);
                }
            }
        }
    }
}

/// Computation of the products of any two rows up to a kernel apart, summed over all rows and over each edge row, and of column sums.
struct Autocorrelation<'a> {
    plan: &'a FirstLayer,
    /// Padded sweeps
    sweeps: &'a [Vec<f32>],
    edges: &'a [usize],
    share: &'a mut Share,
}

impl Autocorrelation<'_> {
    /// Sums the products of padded rows `first..end` with the rows `distance` later, `[ACROSS, lanes]`.
    #[inline(always)]
    fn sum<L: Narrow>(
        (sweeps, row): (&[Vec<f32>], usize),
        (first, end): (usize, usize),
        distance: usize,
        out: &mut [f32],
    ) {
        let lanes = row - 2 * MARGIN;
        for half in (0..lanes).step_by(8) {
            let mut sums = [L::splat(0.0); ACROSS];
            for padded in sweeps {
                for a in first..end {
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
                    0 => (pad, pad + steps),
                    _ => (self.edges[line - 1], self.edges[line - 1] + 1),
                };
                // Of the first rows, only those that a later tap skips are needed; the last rows meet zeros at this distance.
                let later_tap = rows.0 + 1 + distance < self.plan.shape.kernel[0];
                let below = rows.0 >= steps && rows.0 + distance < pad + steps;
                if line > 0 && !later_tap && !below {
                    continue;
                }
                Self::sum::<L>((self.sweeps, row), rows, distance, &mut by_taxel);
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
