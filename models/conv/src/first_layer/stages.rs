//! Kernels of the first layer's tiles.

use super::{FirstLayer, Tile};
use crate::bands::Bands;
use crate::pooling::{Goal, Window, WindowMaps, pool_column};
use crate::shape::BlockShape;
use crate::simd::{Kernel, Lanes, Octet};
use crate::taxel::{Sink, Source};

/// Row of up to eight tiles, one per lane.
struct Tiles<'a>(&'a [Octet]);

impl<L: Lanes> Source<L> for Tiles<'_> {
    #[inline(always)]
    fn at(&self, taxel: usize) -> L {
        L::load(self.0, taxel)
    }
}

/// Row of a band's outputs, one vector of maps each.
struct MapRow<'a, const CUT: bool> {
    bands: &'a Bands,
    band: usize,
    /// Index of the band's first output.
    first: usize,
    row: &'a mut [Octet],
}

impl<L: Lanes, const CUT: bool> Sink<L> for MapRow<'_, CUT> {
    #[inline(always)]
    fn put(&mut self, at: usize, value: L) {
        if !CUT {
            value.store(self.row, at * L::OCTETS);
        } else if let Some(taxel) = self.bands.output(self.band, at) {
            value.store(self.row, (taxel - self.first) * L::OCTETS);
        }
    }
}

/// Spectra of tiles: `[length, width of a band]` to `[column, length, 2]`.
pub(crate) struct Analyze<'a> {
    pub(crate) plan: &'a FirstLayer,
    pub(crate) rows: &'a [Octet],
    pub(crate) spectra: &'a mut [Octet],
}

impl Kernel for Analyze<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let length = self.plan.time.length();
        for (step, row) in self.rows.chunks_exact(self.plan.bands.width).enumerate() {
            let out = &mut self.spectra[2 * step..];
            self.plan.taxel.forward::<L>(Tiles(row), out, 2 * length, 1);
        }
    }
}

/// Product of one lane of the tiles' spectra with the spectra of a vector of kernels.
pub(crate) struct Scale<'a> {
    pub(crate) spectrum: &'a [Octet],
    pub(crate) lane: usize,
    pub(crate) kernel: &'a [Octet],
    pub(crate) product: &'a mut [Octet],
}

impl Kernel for Scale<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let lane = self.lane & 7;
        let pair = 2 * L::OCTETS;
        let factors = self
            .spectrum
            .chunks_exact(2)
            .zip(self.kernel.chunks_exact(pair));
        for ((x, kernel), product) in factors.zip(self.product.chunks_exact_mut(pair)) {
            let (a, b) = (L::splat(x[0].0[lane]), L::splat(x[1].0[lane]));
            let (re, im) = (L::load(kernel, 0), L::load(kernel, L::OCTETS));
            b.mul_sub_from(im, a.mul(re)).store(product, 0);
            b.mul_add(re, a.mul(im)).store(product, L::OCTETS);
        }
    }
}

/// Inverse transform and pooling of a vector of maps of one band and tile.
pub(crate) struct Synthesize<'a, 'b> {
    pub(crate) plan: &'a FirstLayer,
    pub(crate) spectra: &'a [Octet],
    pub(crate) maps: &'a mut [Octet],
    pub(crate) goal: Goal<'a>,
    pub(crate) tile: &'a mut Tile<'b>,
    pub(crate) band: usize,
    /// First octet of the maps.
    pub(crate) column: usize,
}

impl Kernel for Synthesize<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        if self.plan.bands.is_cut() {
            self.of_bands::<L, true>();
        } else {
            self.of_bands::<L, false>();
        }
    }
}

impl Synthesize<'_, '_> {
    #[inline(always)]
    fn of_bands<L: Lanes, const CUT: bool>(self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape {
            taxels,
            maps_out,
            pool,
            ..
        } = plan.shape;
        let values = taxels * maps_out;
        let outputs = plan.bands.outputs(self.band);
        let to = &mut self.tile.to;
        let sums = to.sums.chunks_exact_mut(3 * outs);
        let sums = sums.skip(self.band).step_by(plan.bands.count());
        let windows = to
            .winners
            .chunks_exact_mut(values)
            .zip(to.positions.chunks_exact_mut(values));
        for (window, ((winners, positions), sums)) in windows.zip(sums).enumerate() {
            let steps = (self.tile.steps - window * pool).min(pool);
            let row = outputs.len() * L::OCTETS;
            let maps = &mut self.maps[..steps * row];
            for (step, row) in maps.chunks_exact_mut(row).enumerate() {
                let spectrum = &self.spectra[2 * (window * pool + step) * L::OCTETS..];
                let stride = plan.tile * 2 * L::OCTETS;
                plan.taxel.inverse::<L>(
                    spectrum,
                    stride,
                    L::OCTETS,
                    0,
                    MapRow::<CUT> {
                        bands: &plan.bands,
                        band: self.band,
                        first: outputs.start,
                        row,
                    },
                );
            }
            let mut to = Window {
                winners: &mut winners[outputs.start * maps_out..],
                positions: &mut positions[outputs.start * maps_out..],
                sums,
                columns: outs,
            };
            let maps = WindowMaps {
                values: maps,
                row,
                columns: L::OCTETS,
                first: 0,
            };
            pool_column::<L>(maps, outputs.len(), self.goal, &mut to, self.column);
        }
    }
}
