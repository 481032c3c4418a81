//! The kernels of a spectral block: taxel spectra of inputs, kernels and gradients, and back.

use super::norm::OutputGradient;
use super::pooling::{Goal, Window, pool_column};
use super::shape::BlockShape;
use super::simd::{Kernel, Lanes, Narrow, NarrowKernel, Octet, floats};
use super::spectral_plan::{Plan, in_blocks};
use super::taxel::{MAX_TAXELS, TaxelPlan};

/// Taxel spectra of one sweep: `[steps, taxels, maps_in]` to `[column, block of maps_in, steps, 2, block's octets]`.
pub(super) struct Analyze<'a> {
    pub(super) plan: &'a Plan,
    pub(super) input: &'a [f32],
    pub(super) rows: &'a mut [Octet],
}

impl Kernel for Analyze<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (plan, ins, block) = (self.plan, self.plan.ins, self.plan.in_block);
        let (row, steps) = (plan.shape.taxels * ins * 8, plan.shape.steps);
        for (step, row) in self.input.chunks_exact(row).enumerate() {
            for v in (0..ins).step_by(L::OCTETS) {
                let first = in_blocks(v, block, steps * 2 * block) + step * 2 * block;
                let out = &mut self.rows[first..];
                let values = |taxel: usize| L::load_floats(row, taxel * ins + v);
                plan.taxel.forward::<L>(values, out, steps * 2 * ins, block);
            }
        }
    }
}

/// One taxel frequency of the rows of a vector of kernels: `[kernel steps, kernel taxels]` to `[kernel steps, 2]`.
pub(super) struct KernelRows<'a> {
    pub(super) plan: &'a TaxelPlan,
    pub(super) column: usize,
    pub(super) taps: &'a [Octet],
    pub(super) lags: &'a mut [Octet],
}

impl Kernel for KernelRows<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let row = self.plan.kernel_taxels() * L::OCTETS;
        for (lag, taps) in self
            .lags
            .chunks_exact_mut(2 * L::OCTETS)
            .zip(self.taps.chunks_exact(row))
        {
            let [re, im] = self.plan.kernel::<L>(self.column, taps);
            re.store(lag, 0);
            im.store(lag, L::OCTETS);
        }
    }
}

/// Buffer for the maps of one sweep.
pub(super) enum Maps<'a> {
    /// All of them, `[steps, taxels, maps_out]`, for the backward pass.
    Kept(&'a mut [Octet]),
    /// One pooling window at a time.
    Passing(&'a mut [Octet]),
}

/// Maps of one sweep from the columns, and their pooling windows.
pub(super) struct Synthesize<'a> {
    pub(super) plan: &'a Plan,
    pub(super) sweep: usize,
    pub(super) products: &'a [Octet],
    pub(super) maps: Maps<'a>,
    pub(super) goal: Goal<'a>,
    pub(super) to: Window<'a>,
}

impl Kernel for Synthesize<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape {
            batch,
            steps,
            taxels,
            maps_out,
            pool,
            ..
        } = plan.shape;
        let (row, block) = (taxels * outs, plan.out_block);
        for window in 0..plan.shape.pooled_steps() {
            let here = (steps - window * pool).min(pool) * row;
            let tile = match &mut self.maps {
                Maps::Kept(maps) => &mut maps[window * pool * row..][..here],
                Maps::Passing(tile) => &mut tile[..here],
            };
            let values = window * taxels * maps_out..(window + 1) * taxels * maps_out;
            let mut to = Window {
                winners: &mut self.to.winners[values.clone()],
                positions: &mut self.to.positions[values],
                sums: &mut self.to.sums[window * 3 * outs..(window + 1) * 3 * outs],
                columns: outs,
            };
            for v in (0..outs).step_by(L::OCTETS) {
                for (step, maps) in tile.chunks_exact_mut(row).enumerate() {
                    let first = in_blocks(v, block, batch * steps * 2 * block)
                        + (self.sweep * steps + window * pool + step) * 2 * block;
                    plan.taxel.inverse::<L>(
                        &self.products[first..],
                        batch * steps * 2 * outs,
                        block,
                        batch * steps * 2 * block,
                        |taxel, y: L| {
                            y.store(maps, taxel * outs + v);
                        },
                    );
                }
                pool_column::<L>((tile, outs, v), taxels, self.goal, &mut to, v);
            }
        }
    }
}

/// `dy` of one sweep as taxel spectra, `[column, block of maps_out, steps, 2, block's octets]`.
pub(super) struct Spread<'a> {
    pub(super) plan: &'a Plan,
    pub(super) sweep: usize,
    pub(super) output: OutputGradient<'a>,
    pub(super) maps: &'a [Octet],
    pub(super) rows: &'a mut [Octet],
}

impl Kernel for Spread<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape {
            steps,
            taxels,
            pool,
            ..
        } = plan.shape;
        let (window_row, block) = (taxels * outs, plan.out_block);
        let affine = self.output.affine;
        for (window, tile) in self.maps.chunks(pool * window_row).enumerate() {
            let first = (self.sweep * plan.shape.pooled_steps() + window) * window_row;
            for v in (0..outs).step_by(L::OCTETS) {
                let mut sparse = [[L::splat(0.0); 2]; MAX_TAXELS];
                for taxel in 0..taxels {
                    let at = first + taxel * outs + v;
                    let gradient = L::load_floats(self.output.gradient, at);
                    sparse[taxel] = [
                        gradient.mul(L::load_floats(&affine.ka, v)),
                        L::load_bytes(self.output.positions, at),
                    ];
                }
                let (kb, kc) = (L::load_floats(&affine.kb, v), L::load_floats(&affine.kc, v));
                for (step, maps) in tile.chunks_exact(window_row).enumerate() {
                    let won = L::splat(step as f32);
                    let first =
                        in_blocks(v, block, steps * 2 * block) + (window * pool + step) * 2 * block;
                    let out = &mut self.rows[first..];
                    let values = |taxel: usize| {
                        let [gradient, position] = sparse[taxel];
                        let dense = L::load(maps, taxel * outs + v).mul_add(kc, kb);
                        position.if_equal(won, gradient).add(dense)
                    };
                    plan.taxel
                        .forward::<L>(values, out, steps * 2 * outs, block);
                }
            }
        }
    }
}

/// `[maps_in, 2, maps_out]` to the conjugate of its transpose, `[maps_out, 2, maps_in]`, for `outs` octets of output maps.
pub(super) struct TurnConjugated<'a> {
    pub(super) weight: &'a [Octet],
    pub(super) turned: &'a mut [Octet],
    pub(super) ins: usize,
    pub(super) outs: usize,
}

impl NarrowKernel for TurnConjugated<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Narrow>(self) {
        let TurnConjugated {
            weight,
            turned,
            ins,
            outs,
        } = self;
        let mut rows = [L::splat(0.0); 8];
        for (part, sign) in [(0, 1.0), (1, -1.0)] {
            for (i, weight) in weight.chunks_exact(16 * outs).enumerate() {
                for (o, turned) in turned.chunks_exact_mut(16 * ins).enumerate() {
                    for lane in 0..8 {
                        rows[lane] =
                            L::load(weight, (2 * lane + part) * outs + o).mul(L::splat(sign));
                    }
                    rows = L::transpose(rows);
                    for lane in 0..8 {
                        rows[lane].store(turned, (2 * lane + part) * ins + i);
                    }
                }
            }
        }
    }
}

/// Weight gradients of a vector of output maps from all columns: `[maps, maps_in, kernel steps, kernel taxels]`.
pub(super) struct WeightGradient<'a> {
    pub(super) plan: &'a Plan,
    /// Vector of output maps.
    pub(super) group: usize,
    /// `[column, group of maps_out octets, maps_in, kernel steps, 2]`
    pub(super) d_taps: &'a [Octet],
    pub(super) weight: &'a mut [f32],
}

impl Kernel for WeightGradient<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let plan = self.plan;
        let [kernel_steps, kernel_taxels] = plan.shape.kernel;
        let lags = plan.shape.maps_in * kernel_steps;
        let column_len = lags * plan.outs * 2;
        let mut taps = vec![Octet::ZERO; kernel_taxels * L::OCTETS];
        for lag in 0..lags {
            taps.fill(Octet::ZERO);
            for column in 0..plan.taxel.frequencies() {
                let at = column * column_len + (self.group * lags + lag) * 2 * L::OCTETS;
                let value = [
                    L::load(self.d_taps, at),
                    L::load(self.d_taps, at + L::OCTETS),
                ];
                plan.taxel.add_kernel_inverse::<L>(column, value, &mut taps);
            }
            for (tap, values) in taps.chunks_exact(L::OCTETS).enumerate() {
                for (lane, &value) in floats(values).iter().enumerate() {
                    self.weight[(lane * lags + lag) * kernel_taxels + tap] = value;
                }
            }
        }
    }
}

/// One sweep's input gradient, `[steps, taxels, maps_in]`, from the columns.
pub(super) struct InputGradient<'a> {
    pub(super) plan: &'a Plan,
    pub(super) sweep: usize,
    pub(super) spectra: &'a [Octet],
    pub(super) input: &'a mut [f32],
}

impl Kernel for InputGradient<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (plan, ins, block) = (self.plan, self.plan.ins, self.plan.in_block);
        let BlockShape {
            batch,
            steps,
            taxels,
            ..
        } = plan.shape;
        let row = taxels * ins * 8;
        for (step, row) in self.input.chunks_exact_mut(row).enumerate() {
            for v in (0..ins).step_by(L::OCTETS) {
                let first = in_blocks(v, block, batch * steps * 2 * block)
                    + (self.sweep * steps + step) * 2 * block;
                plan.taxel.inverse::<L>(
                    &self.spectra[first..],
                    batch * steps * 2 * ins,
                    block,
                    8 * block,
                    |taxel, value: L| {
                        value.store_floats(row, taxel * ins + v);
                    },
                );
            }
        }
    }
}
