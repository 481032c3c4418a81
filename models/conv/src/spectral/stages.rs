//! Kernels of the spectral route: taxel spectra of inputs, kernels and gradients, and their inverses.

use super::plan::{Plan, in_blocks};
use crate::bands::Bands;
use crate::norm::OutputGradient;
use crate::pooling::{Goal, Window, WindowMaps, pool_column};
use crate::shape::BlockShape;
use crate::simd::{Kernel, Lanes, Narrow, NarrowKernel, Octet, floats};
use crate::taxel::{MAX_TAXELS, Sink, Source, TaxelPlan};

/// Taxel spectra of one part: from a sweep `[steps, taxels, maps_in]` to `[column, block of maps_in, input steps, 2, block's octets]`.
pub(crate) struct Analyze<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) band: usize,
    pub(crate) range: usize,
    pub(crate) input: &'a [f32],
    pub(crate) rows: &'a mut [Octet],
}

impl Kernel for Analyze<'_> {
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

impl Analyze<'_> {
    #[inline(always)]
    fn of_bands<L: Lanes, const CUT: bool>(self) {
        let (plan, ins, block) = (self.plan, self.plan.ins, self.plan.in_block);
        let (row, seen) = (plan.shape.taxels * ins * 8, plan.ranges.width);
        for at in 0..seen {
            // Values outside the sweep or the array are zero.
            let Some(step) = plan.ranges.input(self.range, at) else {
                for rows in self.rows.chunks_exact_mut(seen * 2 * block) {
                    rows[at * 2 * block..][..2 * block].fill(Octet::ZERO);
                }
                continue;
            };
            let row = &self.input[step * row..][..row];
            for v in (0..ins).step_by(L::OCTETS) {
                let first = in_blocks(v, block, seen * 2 * block) + at * 2 * block;
                let out = &mut self.rows[first..];
                let values = InputRow::<CUT> {
                    bands: &plan.bands,
                    band: self.band,
                    row,
                    ins,
                    v,
                };
                plan.taxel.forward::<L>(values, out, seen * 2 * ins, block);
            }
        }
    }
}

/// One taxel frequency of the rows of a vector of kernels: `[kernel steps, kernel taxels]` to `[kernel steps, 2]`.
pub(crate) struct KernelRows<'a> {
    pub(crate) plan: &'a TaxelPlan,
    pub(crate) column: usize,
    pub(crate) taps: &'a [Octet],
    pub(crate) lags: &'a mut [Octet],
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

/// Maps of one pooling window from the columns, and their pooling.
pub(crate) struct Synthesize<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) sweep: usize,
    pub(crate) window: usize,
    pub(crate) products: &'a [Octet],
    /// `[steps of the window, taxels, maps_out]`
    pub(crate) maps: &'a mut [Octet],
    pub(crate) goal: Goal<'a>,
    /// Output buffers; their sums are `[band, 3, columns]`.
    pub(crate) to: Window<'a>,
}

impl Kernel for Synthesize<'_> {
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

impl Synthesize<'_> {
    #[inline(always)]
    fn of_bands<L: Lanes, const CUT: bool>(self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape {
            taxels,
            maps_out,
            pool,
            ..
        } = plan.shape;
        let (row, block, parts) = (taxels * outs, plan.out_block, plan.parts());
        let span = plan.ranges.span;
        for v in (0..outs).step_by(L::OCTETS) {
            for band in 0..plan.bands.count() {
                for (step, maps) in self.maps.chunks_exact_mut(row).enumerate() {
                    let step = self.window * pool + step;
                    let part = (self.sweep * plan.bands.count() + band) * plan.ranges.count()
                        + step / span;
                    let first = in_blocks(v, block, parts * span * 2 * block)
                        + (part * span + step % span) * 2 * block;
                    plan.taxel.inverse::<L>(
                        &self.products[first..],
                        parts * span * 2 * outs,
                        block,
                        parts * span * 2 * block,
                        MapRow::<CUT> {
                            bands: &plan.bands,
                            band,
                            maps,
                            outs,
                            v,
                        },
                    );
                }
                let outputs = plan.bands.outputs(band);
                let own = outputs.start * maps_out..;
                let mut to = Window {
                    winners: &mut self.to.winners[own.clone()],
                    positions: &mut self.to.positions[own],
                    sums: &mut self.to.sums[band * 3 * outs..][..3 * outs],
                    columns: outs,
                };
                let maps = WindowMaps {
                    values: self.maps,
                    row,
                    columns: outs,
                    first: outputs.start * outs + v,
                };
                pool_column::<L>(maps, outputs.len(), self.goal, &mut to, v);
            }
        }
    }
}

/// Taxel spectra of one part's `dy`, `[column, block of maps_out, steps, 2, block's octets]`; zero outside the part's outputs.
pub(crate) struct Spread<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) sweep: usize,
    pub(crate) band: usize,
    pub(crate) range: usize,
    pub(crate) output: OutputGradient<'a>,
    /// `[steps of the range, taxels, maps_out]`
    pub(crate) maps: &'a [Octet],
    pub(crate) rows: &'a mut [Octet],
}

impl Kernel for Spread<'_> {
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

impl Spread<'_> {
    #[inline(always)]
    fn of_bands<L: Lanes, const CUT: bool>(self) {
        let (plan, outs) = (self.plan, self.plan.outs);
        let BlockShape { taxels, pool, .. } = plan.shape;
        let (window_row, block, span) = (taxels * outs, plan.out_block, plan.ranges.span);
        let affine = self.output.affine;
        // A range consists of whole windows.
        let windows_before =
            self.sweep * plan.shape.pooled_steps() + self.range * (span / pool.min(span));
        for (window, tile) in self.maps.chunks(pool * window_row).enumerate() {
            let first = (windows_before + window) * window_row;
            for v in (0..outs).step_by(L::OCTETS) {
                let mut sparse = [[L::splat(0.0); 2]; MAX_TAXELS];
                let outputs = plan.bands.outputs(self.band);
                for (place, taxel) in (plan.bands.margin()..).zip(outputs) {
                    let at = first + taxel * outs + v;
                    let gradient = L::load_floats(self.output.gradient, at);
                    sparse[place] = [
                        gradient.mul(L::load_floats(&affine.ka, v)),
                        L::load_bytes(self.output.positions, at),
                    ];
                }
                let (kb, kc) = (L::load_floats(&affine.kb, v), L::load_floats(&affine.kc, v));
                for (step, maps) in tile.chunks_exact(window_row).enumerate() {
                    let won = L::splat(step as f32);
                    let first =
                        in_blocks(v, block, span * 2 * block) + (window * pool + step) * 2 * block;
                    let out = &mut self.rows[first..];
                    let values = GradientRow::<L, CUT> {
                        bands: &plan.bands,
                        band: self.band,
                        sparse: &sparse,
                        maps,
                        outs,
                        v,
                        affine: [kb, kc],
                        won,
                    };
                    plan.taxel.forward::<L>(values, out, span * 2 * outs, block);
                }
            }
        }
        let steps = self.maps.len() / window_row;
        if steps < span {
            for rows in self.rows.chunks_exact_mut(span * 2 * block) {
                rows[steps * 2 * block..].fill(Octet::ZERO);
            }
        }
    }
}

/// Conjugate transpose from `[maps_in, 2, maps_out]` to `[maps_out, 2, maps_in]`, for `outs` octets of output maps.
pub(crate) struct TurnConjugated<'a> {
    pub(crate) weight: &'a [Octet],
    pub(crate) turned: &'a mut [Octet],
    pub(crate) ins: usize,
    pub(crate) outs: usize,
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

/// Weight gradients of a vector of output maps from all columns, `[maps, maps_in, kernel steps, kernel taxels]`.
pub(crate) struct WeightGradient<'a> {
    pub(crate) plan: &'a Plan,
    /// Index of the vector of output maps.
    pub(crate) group: usize,
    /// `[column, group of maps_out octets, maps_in, kernel steps, 2]`
    pub(crate) d_taps: &'a [Octet],
    pub(crate) weight: &'a mut [f32],
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

/// Input gradient of one sweep from the columns, `[steps, taxels, maps_in]`.
pub(crate) struct InputGradient<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) sweep: usize,
    pub(crate) spectra: &'a [Octet],
    pub(crate) input: &'a mut [f32],
}

impl Kernel for InputGradient<'_> {
    type Output = ();
    #[inline(always)]
    fn run<L: Lanes>(self) {
        // The gradients of overlapping parts are added.
        if self.plan.bands.is_cut() || self.plan.ranges.is_cut() {
            self.of_parts::<L, true>();
        } else {
            self.of_parts::<L, false>();
        }
    }
}

impl InputGradient<'_> {
    #[inline(always)]
    fn of_parts<L: Lanes, const CUT: bool>(self) {
        let (plan, ins, block) = (self.plan, self.plan.ins, self.plan.in_block);
        let (parts, seen) = (plan.parts(), plan.ranges.width);
        let (bands, ranges) = (plan.bands.count(), plan.ranges.count());
        let row = plan.shape.taxels * ins * 8;
        for (step, row) in self.input.chunks_exact_mut(row).enumerate() {
            if CUT {
                row.fill(0.0);
            }
            for (range, at) in plan.ranges.seeing(step) {
                for band in 0..bands {
                    let part = (self.sweep * bands + band) * ranges + range;
                    for v in (0..ins).step_by(L::OCTETS) {
                        let first = in_blocks(v, block, parts * seen * 2 * block)
                            + (part * seen + at) * 2 * block;
                        plan.taxel.inverse::<L>(
                            &self.spectra[first..],
                            parts * seen * 2 * ins,
                            block,
                            8 * block,
                            InputGradientRow::<CUT> {
                                bands: &plan.bands,
                                band,
                                row,
                                ins,
                                v,
                            },
                        );
                    }
                }
            }
        }
    }
}

/// Vector of maps of an input row; zero outside the array.
struct InputRow<'a, const CUT: bool> {
    bands: &'a Bands,
    band: usize,
    row: &'a [f32],
    ins: usize,
    v: usize,
}

impl<L: Lanes, const CUT: bool> Source<L> for InputRow<'_, CUT> {
    #[inline(always)]
    fn at(&self, at: usize) -> L {
        if !CUT {
            return L::load_floats(self.row, at * self.ins + self.v);
        }
        match self.bands.input(self.band, at) {
            Some(taxel) => L::load_floats(self.row, taxel * self.ins + self.v),
            None => L::splat(0.0),
        }
    }
}

/// Vector of maps of an output row; only the band's outputs are written.
struct MapRow<'a, const CUT: bool> {
    bands: &'a Bands,
    band: usize,
    maps: &'a mut [Octet],
    outs: usize,
    v: usize,
}

impl<L: Lanes, const CUT: bool> Sink<L> for MapRow<'_, CUT> {
    #[inline(always)]
    fn put(&mut self, at: usize, value: L) {
        if !CUT {
            value.store(self.maps, at * self.outs + self.v);
        } else if let Some(taxel) = self.bands.output(self.band, at) {
            value.store(self.maps, taxel * self.outs + self.v);
        }
    }
}

/// Vector of maps of a row of `dy`; zero outside the band's outputs.
struct GradientRow<'a, L, const CUT: bool> {
    bands: &'a Bands,
    band: usize,
    /// Gradient and step of the window's winners, by position in the band.
    sparse: &'a [[L; 2]; MAX_TAXELS],
    maps: &'a [Octet],
    outs: usize,
    v: usize,
    /// `kb` and `kc`
    affine: [L; 2],
    /// Step of the row, compared with the winners' steps.
    won: L,
}

impl<L: Lanes, const CUT: bool> Source<L> for GradientRow<'_, L, CUT> {
    #[inline(always)]
    fn at(&self, at: usize) -> L {
        let taxel = if CUT {
            match self.bands.output(self.band, at) {
                Some(taxel) => taxel,
                None => return L::splat(0.0),
            }
        } else {
            at
        };
        let [gradient, position] = self.sparse[at];
        let [kb, kc] = self.affine;
        let dense = L::load(self.maps, taxel * self.outs + self.v).mul_add(kc, kb);
        position.if_equal(self.won, gradient).add(dense)
    }
}

/// Vector of maps of a row of the input's gradient: a band is added to it, a whole row overwrites it.
struct InputGradientRow<'a, const CUT: bool> {
    bands: &'a Bands,
    band: usize,
    row: &'a mut [f32],
    ins: usize,
    v: usize,
}

impl<L: Lanes, const CUT: bool> Sink<L> for InputGradientRow<'_, CUT> {
    #[inline(always)]
    fn put(&mut self, at: usize, value: L) {
        if !CUT {
            value.store_floats(self.row, at * self.ins + self.v);
        } else if let Some(taxel) = self.bands.input(self.band, at) {
            let at = taxel * self.ins + self.v;
            let sum = L::load_floats(self.row, at).add(value);
            sum.store_floats(self.row, at);
        }
    }
}
