//! Spectral route for many input maps: convolution in the two-dimensional frequency domain.
//!
//! A sweep of `steps x taxels` is transformed with `steps + pad` by `taxels + pad` points. SAME padding needs no more, because
//! only cropped outputs wrap around. At every frequency the convolution is one complex matrix product,
//! `[batch, maps_in] x [maps_in, maps_out]`. The backward pass uses the same spectra.
//!
//! Each taxel frequency (a *column*) goes separately through its time spectrum, its products and back, and its output maps in
//! blocks of sixteen, so that only these spectra need to stay in a core's cache. Columns are the units that threads share.

mod backward;
mod backward_column;
mod column;
pub(super) mod plan;
pub(super) mod stages;

use std::sync::Arc;

use rayon::prelude::*;

use super::buffers::{Buffers, OCTETS};
use super::cost::Tiling;
use super::norm::Pooled;
use super::pooling::{Goal, PoolBuffers, Window, merge_sums};
use super::shape::BlockShape;
use super::simd::{Isa, Octet, Octets};
use super::weight::{Remembered, Weight};
use column::{Column, weight_spectrum};
use plan::{Plan, by_group};
use stages::{Analyze, Synthesize};

/// Plan with cached weight spectra.
#[derive(Debug)]
pub(super) struct Spectral {
    /// Plan for a full group of sweeps.
    pub(super) plan: Plan,
    /// Plan for the remaining sweeps at the end of a batch.
    rest: Option<Plan>,
    /// True if threads share groups of sweeps, because a group has few columns.
    at_once: bool,
    weights: Remembered<Octets>,
    pub(super) buffers: &'static Buffers<Octets>,
}

/// State for the backward pass.
#[derive(Debug)]
pub(super) struct SavedSpectral {
    /// `[column, block of maps_out, time frequency, maps_in, 2, block's octets]`
    pub(super) weight: Arc<Octets>,
    pub(super) groups: Vec<SavedGroup>,
}

/// Saved spectra and maps of one group of sweeps.
#[derive(Debug)]
pub(super) struct SavedGroup {
    /// `[column, time frequency, parts, 2, maps_in]`
    pub(super) input: Octets,
    /// `[sweeps, steps, taxels, maps_out]`, empty without a backward pass
    pub(super) maps: Octets,
}

/// Maximum number of octets between the stages (64 MiB), which limits a group's sweeps unless one sweep has more.
const MAX_BETWEEN: usize = 1 << 21;
/// Minimum number of columns for threads to share; with fewer, threads share groups of sweeps.
const MIN_TASKS: usize = 8;

impl Spectral {
    pub(super) fn new(shape: BlockShape, isa: Isa) -> Option<Self> {
        Self::tiled(shape, isa, Tiling::cheapest(&shape, isa)?)
    }

    /// Plans the route with a given tiling.
    pub(super) fn tiled(shape: BlockShape, isa: Isa, tiling: Tiling) -> Option<Self> {
        let of = |batch: usize| Plan::tiled(BlockShape { batch, ..shape }, isa, tiling);
        let one = of(1)?;
        let columns = one.taxel.frequencies();
        let fitting = (MAX_BETWEEN / one.between()).clamp(1, shape.batch);
        let shared = (shape.batch * columns / MIN_TASKS).max(1);
        let together = shape
            .batch
            .div_ceil(shape.batch.div_ceil(fitting.min(shared)));
        Some(Self {
            plan: of(together)?,
            rest: match shape.batch % together {
                0 => None,
                left => Some(of(left)?),
            },
            at_once: columns < MIN_TASKS,
            weights: Remembered::default(),
            buffers: &OCTETS,
        })
    }

    /// Returns the plan for a group with `values` values, where one sweep has `sweep` values.
    pub(super) fn plan_of(&self, values: usize, sweep: usize) -> &Plan {
        let whole = values == self.plan.shape.batch * sweep;
        let rest = if whole { None } else { self.rest.as_ref() };
        rest.unwrap_or(&self.plan)
    }

    /// Returns the minimum number of groups per thread: all, unless threads share groups.
    pub(super) fn groups_of_thread(&self) -> usize {
        if self.at_once { 1 } else { usize::MAX }
    }

    /// Convolves, pools and overwrites `to` with winners (or outputs) and positions; for winners it saves the state for the backward pass.
    pub(super) fn forward(
        &self,
        input: &[f32],
        weight: &Weight<'_>,
        goal: Goal<'_>,
        to: PoolBuffers,
    ) -> (Pooled, SavedSpectral) {
        let plan = &self.plan;
        let PoolBuffers {
            mut winners,
            mut positions,
        } = to;
        let weight = self.weights.get_or_make(weight, |before| {
            before.into_iter().for_each(|made| self.buffers.give(made));
            self.weight_spectra(&weight.values())
        });
        let [sweep_in, sweep_out] =
            [plan.shape.input_len(), plan.shape.output_len()].map(|len| len / plan.shape.batch);
        let sweep_sums = plan.shape.pooled_steps() * plan.bands.count() * 3 * plan.outs;
        let mut sums = self.buffers.take(input.len() / sweep_in * sweep_sums);
        let together = plan.shape.batch;
        let groups = winners
            .par_chunks_mut(together * sweep_out)
            .zip(positions.par_chunks_mut(together * sweep_out))
            .zip(sums.par_chunks_mut(together * sweep_sums))
            .zip(input.par_chunks(together * sweep_in))
            .with_min_len(self.groups_of_thread())
            .map(|(((winners, positions), sums), input)| {
                let to = Window {
                    winners,
                    positions,
                    sums,
                    columns: plan.outs,
                };
                let plan = self.plan_of(input.len(), sweep_in);
                self.forward_group(plan, input, &weight, goal, to)
            })
            .collect();
        let moments = goal
            .is_winners()
            .then(|| merge_sums(&sums, plan.outs, &plan.shape, &plan.bands));
        self.buffers.give(sums);
        let pooled = Pooled {
            winners,
            positions,
            moments,
        };
        (pooled, SavedSpectral { weight, groups })
    }

    /// Convolves and pools the sweeps of one group; the sums are `[sweep, window, band, 3, columns]`.
    fn forward_group(
        &self,
        plan: &Plan,
        input: &[f32],
        weight: &[Octet],
        goal: Goal<'_>,
        to: Window<'_>,
    ) -> SavedGroup {
        let (shape, columns, length) = (plan.shape, plan.taxel.frequencies(), plan.time.length());
        let part = columns * plan.ranges.width * 2 * plan.ins;
        let mut rows = self.buffers.take(plan.parts() * part);
        rows.par_chunks_exact_mut(part)
            .enumerate()
            .for_each(|(part, rows)| {
                let (sweep, band, range) = plan.place(part);
                let sweep_len = shape.input_len() / shape.batch;
                let stage = Analyze {
                    plan,
                    band,
                    range,
                    input: &input[sweep * sweep_len..][..sweep_len],
                    rows,
                };
                plan.isa.run(plan.ins, stage)
            });
        let mut input = self.buffers.take(columns * length * plan.input_stride());
        let mut products = self
            .buffers
            .take(columns * plan.parts() * plan.ranges.span * 2 * plan.outs);
        input
            .par_chunks_exact_mut(length * plan.input_stride())
            .zip(weight.par_chunks_exact(plan.weight_column()))
            .zip(products.par_chunks_exact_mut(plan.parts() * plan.ranges.span * 2 * plan.outs))
            .enumerate()
            .for_each(|(column, ((input, weight), out))| {
                let mut spectrum = self.buffers.take(length * plan.output_stride());
                let mut scratch = self.buffers.take(plan.time.scratch(2));
                Column {
                    plan,
                    column,
                    rows: &rows,
                    input,
                    weight,
                    spectrum: &mut spectrum,
                    out,
                    scratch: &mut scratch,
                }
                .run();
                self.buffers.give(spectrum);
                self.buffers.give(scratch);
            });
        let mut maps = self.buffers.take(if goal.is_winners() {
            shape.count() * plan.outs
        } else {
            0
        });
        self.pool(plan, &products, &mut maps, goal, to);
        for buffer in [rows, products] {
            self.buffers.give(buffer);
        }
        SavedGroup { input, maps }
    }

    /// Returns the spectra of all kernels, column by column.
    fn weight_spectra(&self, weight: &[f32]) -> Octets {
        let plan = &self.plan;
        let columns = plan.taxel.frequencies();
        let mut taps = self.buffers.take(weight.len() / 8);
        let row = weight.len() / plan.shape.maps_out;
        by_group(weight, row, plan.out_group, &mut taps);
        let mut spectra = self.buffers.take(columns * plan.weight_column());
        spectra
            .par_chunks_exact_mut(plan.weight_column())
            .enumerate()
            .for_each(|(column, spectrum)| {
                let mut scratch = self.buffers.take(plan.time.scratch(2));
                weight_spectrum(plan, column, &taps, spectrum, &mut scratch);
                self.buffers.give(scratch);
            });
        self.buffers.give(taps);
        spectra
    }

    fn pool(
        &self,
        plan: &Plan,
        products: &[Octet],
        maps: &mut [Octet],
        goal: Goal<'_>,
        to: Window<'_>,
    ) {
        let shape = &plan.shape;
        let (windows, bands) = (shape.pooled_steps(), plan.bands.count());
        let row = shape.taxels * shape.maps_out;
        let kept: Vec<Option<&mut [Octet]>> = if maps.is_empty() {
            (0..shape.batch * windows).map(|_| None).collect()
        } else {
            let sweeps = maps.chunks_exact_mut(shape.steps * shape.taxels * plan.outs);
            sweeps
                .flat_map(|maps| maps.chunks_mut(shape.pool * shape.taxels * plan.outs))
                .map(Some)
                .collect()
        };
        to.winners
            .par_chunks_exact_mut(row)
            .zip(to.positions.par_chunks_exact_mut(row))
            .zip(to.sums.par_chunks_exact_mut(bands * 3 * plan.outs))
            .zip(kept)
            .enumerate()
            .for_each(|(index, (((winners, positions), sums), kept))| {
                let (sweep, window) = (index / windows, index % windows);
                let steps = (shape.steps - window * shape.pool).min(shape.pool);
                let mut passing = self.buffers.take(match kept {
                    Some(_) => 0,
                    None => shape.pool * shape.taxels * plan.outs,
                });
                let maps = match kept {
                    Some(maps) => maps,
                    None => &mut passing[..steps * shape.taxels * plan.outs],
                };
                let to = Window {
                    winners,
                    positions,
                    sums,
                    columns: plan.outs,
                };
                let stage = Synthesize {
                    plan,
                    sweep,
                    window,
                    products,
                    maps,
                    goal,
                    to,
                };
                plan.isa.run(plan.outs, stage);
                self.buffers.give(passing);
            });
    }

    pub(super) fn recycle_group(&self, group: SavedGroup) {
        for buffer in [group.input, group.maps] {
            self.buffers.give(buffer);
        }
    }

    /// Returns the buffers of a forward pass to the pool.
    pub(super) fn recycle(&self, saved: SavedSpectral) {
        for group in saved.groups {
            self.recycle_group(group);
        }
        // The last reference returns the weights' spectra.
        if let Some(weight) = Arc::into_inner(saved.weight) {
            self.buffers.give(weight);
        }
    }
}
