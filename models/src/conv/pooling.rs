//! One pooling window, eight maps to a vector: winners, their steps, and sums for the batch statistics, while the maps are in cache.

use rayon::prelude::*;

use super::norm::Moments;
use super::simd::{Lanes, Octet, floats};

/// Where a window's results go.
pub(super) struct Window<'a> {
    /// `[taxels, maps]`
    pub(super) winners: &'a mut [f32],
    /// `[taxels, maps]`
    pub(super) positions: &'a mut [u8],
    /// `[3, columns]`: pivot, sum and sum of squares of `y - pivot`
    pub(super) sums: &'a mut [Octet],
    /// Octets of maps in a row of these.
    pub(super) columns: usize,
}

/// Chooses the winners of the map octets from `column` on within `tile`, `[steps, taxels, tile columns]`, where they lie from
/// `tile_column` on.
///
/// `signs` are 1 where the largest value wins and -1 where the smallest does.
#[inline(always)]
pub(super) fn pool_column<L: Lanes>(
    (tile, tile_columns, tile_column): (&[Octet], usize, usize),
    taxels: usize,
    signs: &[Octet],
    to: &mut Window<'_>,
    column: usize,
) {
    let columns = to.columns;
    let sign = L::load(signs, column);
    let pivot = L::load(tile, taxels / 2 * tile_columns + tile_column);
    let (mut sum, mut squares) = (L::splat(0.0), L::splat(0.0));
    for taxel in 0..taxels {
        let first = taxel * tile_columns + tile_column;
        let target = taxel * columns + column;
        let mut best = L::load(tile, first).mul(sign);
        let mut position = L::splat(0.0);
        let mut step = L::splat(0.0);
        for row in tile.chunks_exact(taxels * tile_columns) {
            let y = L::load(row, first);
            let offset = y.sub(pivot);
            sum = sum.add(offset);
            squares = offset.mul_add(offset, squares);
            let signed = y.mul(sign);
            position = signed.if_greater(best, step, position);
            best = best.max(signed);
            step = step.add(L::splat(1.0));
        }
        best.mul(sign).store_floats(to.winners, target);
        position.store_bytes(to.positions, target);
    }
    pivot.store(to.sums, column);
    sum.store(to.sums, columns + column);
    squares.store(to.sums, 2 * columns + column);
}

/// Windows whose sums a thread merges at once.
const RUN: usize = 64;

/// Merges the sums of windows, in an order that does not depend on threads; `count` tells how many values per map a window of that index
/// holds.
pub(super) fn merge_sums(
    sums: &[Octet],
    columns: usize,
    count: impl Fn(usize) -> usize + Sync,
) -> Moments {
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
