//! First layer tap by tap, for processors with AVX-512, which multiply much faster than they move data.
//!
//! With one input map an output takes only `kernel steps * kernel taxels` products, 75 for TactNet-II. The tiles' transforms save two thirds
//! of them, but move data through the cache several times. Here ten steps of two vectors of maps are summed in registers and
//! pooled from the L1 cache.

use rayon::prelude::*;

use super::padding::MARGIN;
use super::{FirstLayer, Tile};
use crate::pooling::{Goal, Window, WindowMaps, pool_column};
use crate::shape::BlockShape;
use crate::simd::{Isa, Kernel, Lanes, Octet, Octets, Walk};
use crate::spectral::plan::by_group;

/// Number of output steps that are summed at once.
const STRIP: usize = 10;
/// Number of vectors of maps that are summed at once.
const VECTORS: usize = 2;

/// Returns true if the shape is convolved tap by tap.
pub(crate) fn by_taps(shape: &BlockShape, isa: Isa) -> bool {
    let octets = shape.maps_out / 8;
    let whole = octets.is_multiple_of(2 * VECTORS) && shape.pool.is_multiple_of(STRIP);
    isa.group(octets) == 2 && whole
}

impl FirstLayer {
    /// Reorders weights to `[panel of maps_out octets, kernel step, kernel taxel, octets of a panel]`.
    pub(crate) fn panels(&self, weight: &[f32]) -> Octets {
        let taps = self.shape.kernel[0] * self.shape.kernel[1];
        let mut panels = self.buffers.take(weight.len() / 8);
        by_group(weight, taps, VECTORS * self.group, &mut panels);
        panels
    }

    /// Convolves and pools every tile.
    pub(crate) fn convolve_by_taps(
        &self,
        panels: &[Octet],
        goal: Goal<'_>,
        tiles: &mut [Tile<'_>],
    ) {
        let pool = self.shape.pool;
        let rows = self.tile + self.shape.kernel[0] - 1;
        tiles.par_iter_mut().for_each(|tile| {
            let mut padded = self.values.take(rows * self.row());
            let mut maps = self
                .buffers
                .take(pool * self.bands.span * VECTORS * self.group);
            self.pad_tile(tile, &mut padded);
            let stage = Taps {
                plan: self,
                panels,
                padded: &padded,
                maps: &mut maps,
                goal,
                tile,
            };
            self.isa.run(self.outs, stage);
            self.values.give(padded);
            self.buffers.give(maps);
        });
    }

    /// Copies the input rows of a tile to `padded`, `[rows, row]`, with zeros around them.
    fn pad_tile(&self, tile: &Tile<'_>, padded: &mut [f32]) {
        let (taxels, pad) = (self.shape.taxels, self.shape.padding()[0]);
        padded.fill(0.0);
        let begin = tile.first.saturating_sub(pad);
        let rows = padded
            .chunks_exact_mut(self.row())
            .skip(begin + pad - tile.first)
            .zip(tile.input[begin * taxels..].chunks_exact(taxels));
        for (row, values) in rows {
            row[MARGIN..MARGIN + taxels].copy_from_slice(values);
        }
    }
}

/// Convolution and pooling of all maps of one tile.
struct Taps<'a, 'b> {
    plan: &'a FirstLayer,
    /// Weights from [`FirstLayer::panels`].
    panels: &'a [Octet],
    /// `[tile + kernel steps - 1, row]`
    padded: &'a [f32],
    /// `[pool, taxels of a band, octets of a panel]`
    maps: &'a mut [Octet],
    goal: Goal<'a>,
    tile: &'a mut Tile<'b>,
}

/// Sums of a strip, in pairs of steps.
type Strip<L> = [[[L; VECTORS]; 2]; STRIP / 2];

impl Taps<'_, '_> {
    /// Returns one taxel's strip that begins at step `first` of the tile.
    #[inline(always)]
    fn strip<L: Lanes>(&self, panel: &[Octet], first: usize, taxel: usize) -> Strip<L> {
        let shape = &self.plan.shape;
        let [kernel_steps, kernel_taxels] = shape.kernel;
        let (octets, row) = (VECTORS * L::OCTETS, self.plan.row());
        let mut offsets = [[0; 2]; STRIP / 2];
        for (pair, offset) in offsets.iter_mut().enumerate() {
            *offset = [2 * pair * row, (2 * pair + 1) * row];
        }
        let mut sums = [[[L::splat(0.0); VECTORS]; 2]; STRIP / 2];
        // Kernel columns outside the taxels contribute zero and are skipped.
        let corner = MARGIN - shape.padding()[1] + taxel;
        let met =
            MARGIN.saturating_sub(corner)..(MARGIN + shape.taxels - corner).min(kernel_taxels);
        for across in met {
            let rows = &self.padded[first * row + corner + across..];
            let mut rows = Walk::<f32, L, { STRIP / 2 }>::new(rows, row, kernel_steps, offsets);
            let (taps, stride) = (&panel[across * octets..], kernel_taxels * octets);
            let vectors = [[0, L::OCTETS]];
            let mut taps = Walk::<Octet, L, 1>::new(taps, stride, kernel_steps, vectors);
            while let (Some(rows), Some([tap])) = (rows.step(), taps.step()) {
                for pair in 0..STRIP / 2 {
                    for half in 0..2 {
                        let x = L::splat(rows[pair][half]);
                        for v in 0..VECTORS {
                            sums[pair][half][v] = x.mul_add(tap[v], sums[pair][half][v]);
                        }
                    }
                }
            }
        }
        sums
    }
}

impl Kernel for Taps<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape {
            taxels,
            maps_out,
            pool,
            kernel,
            ..
        } = plan.shape;
        let (values, octets) = (taxels * maps_out, VECTORS * L::OCTETS);
        for window in 0..self.tile.steps.div_ceil(pool) {
            let steps = (self.tile.steps - window * pool).min(pool);
            for band in 0..plan.bands.count() {
                let outputs = plan.bands.outputs(band);
                let row = outputs.len() * octets;
                let panels = self.panels.chunks_exact(kernel[0] * kernel[1] * octets);
                for (panel, column) in panels.zip((0..).step_by(octets)) {
                    for first in (0..steps).step_by(STRIP) {
                        for taxel in outputs.clone() {
                            let sums = self.strip::<L>(panel, window * pool + first, taxel);
                            for step in 0..STRIP {
                                let at = (first + step) * row + (taxel - outputs.start) * octets;
                                for v in 0..VECTORS {
                                    let sum = sums[step / 2][step % 2][v];
                                    sum.store(self.maps, at + v * L::OCTETS);
                                }
                            }
                        }
                    }
                    let to = &mut self.tile.to;
                    let own = window * values + outputs.start * maps_out..(window + 1) * values;
                    let sums = (window * plan.bands.count() + band) * 3 * outs;
                    let mut to = Window {
                        winners: &mut to.winners[own.clone()],
                        positions: &mut to.positions[own],
                        sums: &mut to.sums[sums..][..3 * outs],
                        columns: outs,
                    };
                    for v in (0..octets).step_by(L::OCTETS) {
                        let maps = WindowMaps {
                            values: &self.maps[..steps * row],
                            row,
                            columns: octets,
                            first: v,
                        };
                        pool_column::<L>(maps, outputs.len(), self.goal, &mut to, column + v);
                    }
                }
            }
        }
    }
}
