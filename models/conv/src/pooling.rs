//! Pooling of one window while its maps are in cache, one map per lane: winners, their steps and sums for the batch statistics or, with
//! fixed statistics, outputs.

use rayon::prelude::*;

use super::bands::Bands;
use super::norm::Moments;
use super::shape::BlockShape;
use super::simd::{Lanes, Octet, floats};

/// Result of pooling: winners or outputs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Goal<'a> {
    /// `[octets of maps]`: factor after which the winner is the largest value.
    factor: &'a [Octet],
    shift: Option<&'a [Octet]>,
}

impl<'a> Goal<'a> {
    /// Requests winners: the largest value where `signs` are 1, the smallest where they are -1.
    pub(super) fn winners(signs: &'a [Octet]) -> Self {
        Self {
            factor: signs,
            shift: None,
        }
    }

    /// Requests the outputs `max(0, scale * y + shift)` of the winners `y` in place of winners, without steps and sums.
    pub(super) fn outputs(scale: &'a [Octet], shift: &'a [Octet]) -> Self {
        Self {
            factor: scale,
            shift: Some(shift),
        }
    }

    /// Returns true if winners are requested, not outputs.
    pub(super) fn is_winners(&self) -> bool {
        self.shift.is_none()
    }

    /// Returns the goal for block `block` of `octets` octets of maps.
    pub(super) fn of_block(self, block: usize, octets: usize) -> Self {
        let range = block * octets..(block + 1) * octets;
        Self {
            factor: &self.factor[range.clone()],
            shift: self.shift.map(|shift| &shift[range]),
        }
    }
}

/// Buffers for winners (or outputs) and their positions, `[batch, pooled_steps, taxels, maps_out]` each.
pub(super) struct PoolBuffers {
    pub(super) winners: Vec<f32>,
    pub(super) positions: Vec<u8>,
}

/// Output buffers of a window.
pub(super) struct Window<'a> {
    /// `[taxels, maps]`
    pub(super) winners: &'a mut [f32],
    /// `[taxels, maps]`
    pub(super) positions: &'a mut [u8],
    /// `[3, columns]`: pivot, sum and sum of squares of `y - pivot`
    pub(super) sums: &'a mut [Octet],
    /// Octets of maps in a row of these buffers.
    pub(super) columns: usize,
}

/// Maps of a window's steps: taxel `w` of step `t` is at octet `t * row + first + w * columns`.
#[derive(Clone, Copy)]
pub(super) struct WindowMaps<'a> {
    pub(super) values: &'a [Octet],
    /// Octets per step.
    pub(super) row: usize,
    /// Octets per taxel.
    pub(super) columns: usize,
    /// Octet of the first taxel.
    pub(super) first: usize,
}

/// Pools a vector of maps over `taxels` taxels; `column` is its octet in `goal` and `to`.
#[inline(always)]
pub(super) fn pool_column<L: Lanes>(
    maps: WindowMaps<'_>,
    taxels: usize,
    goal: Goal<'_>,
    to: &mut Window<'_>,
    column: usize,
) {
    let columns = to.columns;
    let tile = maps.values;
    let factor = L::load(goal.factor, column);
    if let Some(shift) = goal.shift {
        let (shift, zero) = (L::load(shift, column), L::splat(0.0));
        for taxel in 0..taxels {
            let first = maps.first + taxel * maps.columns;
            let mut best = L::load(tile, first).mul(factor);
            for row in tile.chunks_exact(maps.row).skip(1) {
                best = best.max(L::load(row, first).mul(factor));
            }
            let output = best.add(shift).max(zero);
            output.store_floats(to.winners, taxel * columns + column);
        }
        return;
    }
    let pivot = L::load(tile, maps.first + taxels / 2 * maps.columns);
    let (mut sum, mut squares) = (L::splat(0.0), L::splat(0.0));
    for taxel in 0..taxels {
        let first = maps.first + taxel * maps.columns;
        let target = taxel * columns + column;
        let mut best = L::load(tile, first).mul(factor);
        let mut position = L::splat(0.0);
        let mut step = L::splat(0.0);
        for row in tile.chunks_exact(maps.row) {
            let y = L::load(row, first);
            let offset = y.sub(pivot);
            sum = sum.add(offset);
            squares = offset.mul_add(offset, squares);
            let signed = y.mul(factor);
            position = signed.if_greater(best, step, position);
            best = best.max(signed);
            step = step.add(L::splat(1.0));
        }
        best.mul(factor).store_floats(to.winners, target);
        position.store_bytes(to.positions, target);
    }
    pivot.store(to.sums, column);
    sum.store(to.sums, columns + column);
    squares.store(to.sums, 2 * columns + column);
}

/// Number of windows whose sums one task merges.
const RUN: usize = 64;

/// Merges the sums of windows, `[batch, window, band, 3, columns]`, in an order that does not depend on threads.
pub(super) fn merge_sums(
    sums: &[Octet],
    columns: usize,
    shape: &BlockShape,
    bands: &Bands,
) -> Moments {
    let count = |index: usize| {
        let (window, band) = (
            index / bands.count() % shape.pooled_steps(),
            index % bands.count(),
        );
        let steps = (shape.steps - window * shape.pool).min(shape.pool);
        steps * bands.outputs(band).len()
    };
    let run = |(run, sums): (usize, &[Octet])| {
        let mut moments = Moments::new(columns * 8);
        for (window, sums) in sums.chunks_exact(3 * columns).enumerate() {
            let (pivot, rest) = floats(sums).split_at(8 * columns);
            let (sum, squares) = rest.split_at(8 * columns);
            moments.add_shifted(count(run * RUN + window), pivot, sum, squares);
        }
        moments
    };
    let runs = sums.par_chunks(RUN * 3 * columns).enumerate().map(run);
    let mut moments = Moments::new(columns * 8);
    for run in runs.collect::<Vec<_>>() {
        moments.merge(&run);
    }
    moments
}

/// Converts one value per map to whole octets.
pub(super) fn octets(values: &[f32]) -> Vec<Octet> {
    let (octets, _) = values.as_chunks::<8>();
    octets.iter().map(|octet| Octet(*octet)).collect()
}

/// Returns 1 where gamma is not negative, else -1.
pub(super) fn signs(gamma: &[f32]) -> Vec<Octet> {
    let sign = |g: f32| if g < 0.0 { -1.0 } else { 1.0 };
    let octets = octets(gamma).into_iter();
    octets.map(|octet| Octet(octet.0.map(sign))).collect()
}
