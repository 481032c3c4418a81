//! The steps of the first block that run on vector lanes.

use super::pooling::{Window, pool_column};
use super::shape::BlockShape;
use super::simd::{Kernel, Lanes, Octet};
use super::single::{Single, Tile};

/// `[length, taxels]` to `[column, length, 2]`.
pub(super) struct Analyze<'a> {
    pub(super) plan: &'a Single,
    pub(super) rows: &'a [Octet],
    pub(super) spectra: &'a mut [Octet],
}

impl Kernel for Analyze<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let length = self.plan.time.length();
        for (step, row) in self.rows.chunks_exact(self.plan.shape.taxels).enumerate() {
            let out = &mut self.spectra[2 * step..];
            self.plan
                .taxel
                .forward::<L>(|taxel| L::load(&row[taxel]), out, 2 * length, 1);
        }
    }
}

/// All taxel frequencies of the rows of eight kernels, `[column, kernel steps, 2]`.
pub(super) struct KernelRows<'a> {
    pub(super) plan: &'a Single,
    pub(super) taps: &'a [Octet],
    pub(super) lags: &'a mut [Octet],
}

impl Kernel for KernelRows<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let [kernel_steps, kernel_taxels] = self.plan.shape.kernel;
        for (column, lags) in self.lags.chunks_exact_mut(2 * kernel_steps).enumerate() {
            for (lag, taps) in lags
                .chunks_exact_mut(2)
                .zip(self.taps.chunks_exact(kernel_taxels))
            {
                let [re, im] = self.plan.taxel.kernel::<L>(column, taps);
                re.store(&mut lag[0]);
                im.store(&mut lag[1]);
            }
        }
    }
}

/// One lane of the tiles' spectra times the spectra of eight kernels.
pub(super) struct Scale<'a> {
    pub(super) spectrum: &'a [Octet],
    pub(super) lane: usize,
    pub(super) kernel: &'a [Octet],
    pub(super) product: &'a mut [Octet],
}

impl Kernel for Scale<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let lane = self.lane & 7;
        let factors = self
            .spectrum
            .chunks_exact(2)
            .zip(self.kernel.chunks_exact(2));
        for ((x, kernel), product) in factors.zip(self.product.chunks_exact_mut(2)) {
            let (a, b) = (L::splat(x[0].0[lane]), L::splat(x[1].0[lane]));
            let (re, im) = (L::load(&kernel[0]), L::load(&kernel[1]));
            b.mul_sub_from(im, a.mul(re)).store(&mut product[0]);
            b.mul_add(re, a.mul(im)).store(&mut product[1]);
        }
    }
}

/// Eight maps of one tile, window by window, and their winners.
pub(super) struct Synthesize<'a, 'b> {
    pub(super) plan: &'a Single,
    pub(super) spectra: &'a [Octet],
    pub(super) maps: &'a mut [Octet],
    pub(super) sign: &'a Octet,
    pub(super) tile: &'a mut Tile<'b>,
    pub(super) column: usize,
}

impl Kernel for Synthesize<'_, '_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape {
            taxels,
            maps_out,
            pool,
            ..
        } = plan.shape;
        let values = taxels * maps_out;
        let to = &mut self.tile.to;
        let windows = to
            .winners
            .chunks_exact_mut(values)
            .zip(to.positions.chunks_exact_mut(values));
        for (window, ((winners, positions), sums)) in
            windows.zip(to.sums.chunks_exact_mut(3 * outs)).enumerate()
        {
            let steps = (self.tile.steps - window * pool).min(pool);
            let maps = &mut self.maps[..steps * taxels];
            for (step, row) in maps.chunks_exact_mut(taxels).enumerate() {
                let spectrum = &self.spectra[2 * (window * pool + step)..];
                plan.taxel
                    .inverse::<L>(spectrum, plan.tile * 2, 1, |taxel, y: L| {
                        y.store(&mut row[taxel])
                    });
            }
            let mut to = Window {
                winners,
                positions,
                sums,
                columns: outs,
            };
            pool_column::<L>((maps, 1, 0), taxels, self.sign, &mut to, self.column);
        }
    }
}
