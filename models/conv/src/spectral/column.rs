//! One column of the forward pass.

use super::plan::{Plan, following, in_blocks};
use super::stages::KernelRows;
use crate::fft::Transform;
use crate::product::{Left, Soon};
use crate::simd::{NOTHING, NOWHERE, Octet, Octets, Rows, WRITTEN, floats};

/// Forward pass of one column: time spectra of the input, then for each block of output maps the products and the inverse transform,
/// `[block, parts, steps, 2, block's octets]`.
pub(crate) struct Column<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) column: usize,
    pub(crate) rows: &'a [Octet],
    pub(crate) input: &'a mut [Octet],
    pub(crate) weight: &'a [Octet],
    pub(crate) spectrum: &'a mut [Octet],
    pub(crate) out: &'a mut [Octet],
    pub(crate) scratch: &'a mut [Octet],
}

impl Column<'_> {
    pub(crate) fn run(mut self) {
        self.transform();
        for block in 0..self.plan.out_blocks() {
            self.multiply(block);
            self.transform_back(block);
        }
    }

    /// Computes the time spectra of the input.
    fn transform(&mut self) {
        let (plan, column) = (self.plan, self.column);
        let (seen, ins, block) = (plan.ranges.width, plan.ins, plan.in_block);
        let columns = plan.taxel.frequencies();
        for part in 0..plan.parts() {
            let source = &self.rows[(part * columns + column) * seen * 2 * ins..][..seen * 2 * ins];
            for v in (0..ins).step_by(plan.in_group) {
                let first = in_blocks(v, block, seen * 2 * block);
                let from = Rows {
                    table: &plan.seen,
                    stride: 2 * block,
                    parts: [first, first + block],
                    ahead: columns * seen * 2 * ins,
                };
                let at = part * 2 * ins + v;
                let to = Rows {
                    table: plan.wanted(column),
                    stride: plan.input_stride(),
                    parts: [at, at + ins],
                    ahead: WRITTEN,
                };
                let transform = Transform {
                    plan: &plan.time,
                    source,
                    from,
                    target: self.input,
                    to,
                    scratch: self.scratch,
                };
                plan.isa.run(ins, transform);
            }
        }
    }

    /// Computes the products of a block of output maps at all frequencies.
    fn multiply(&mut self, block: usize) {
        let plan = self.plan;
        let (parts, maps_in) = (plan.parts(), plan.shape.maps_in);
        let span = plan.time.length() * plan.weight_stride();
        let weight = &self.weight[block * span..][..span];
        let octets = plan.out_block;
        let lefts = self.input.chunks_exact(plan.input_stride());
        let rights = weight.chunks_exact(plan.weight_stride());
        let products = self.spectrum.chunks_exact_mut(plan.output_stride());
        let nexts = following(lefts.clone()).zip(following(rights.clone()));
        let products = lefts.zip(rights).zip(products).zip(nexts);
        for ((((left, right), out), next), &row) in products.zip(plan.wanted(self.column).rows()) {
            if row != NOWHERE {
                let left = Left {
                    values: floats(left),
                    row: 2 * maps_in,
                    inner: 1,
                    imaginary: maps_in,
                    soon: Soon {
                        left: floats(next.0),
                        right: next.1,
                    },
                };
                left.times(
                    plan.isa,
                    &right[..maps_in * 2 * octets],
                    &mut out[..parts * 2 * octets],
                    octets,
                );
            }
        }
        plan.mirror(
            plan.taxel.mirror(self.column),
            self.spectrum,
            plan.output_stride(),
            octets,
        );
    }

    /// Transforms the products of a block of output maps back to steps.
    fn transform_back(&mut self, block: usize) {
        let plan = self.plan;
        let (octets, part_len) = (plan.out_block, plan.ranges.span * 2 * plan.out_block);
        let out = &mut self.out[block * plan.parts() * part_len..][..plan.parts() * part_len];
        for (part, out) in out.chunks_exact_mut(part_len).enumerate() {
            for v in (0..octets).step_by(plan.out_group) {
                let at = part * 2 * octets + v;
                let from = Rows {
                    table: &plan.all,
                    stride: plan.output_stride(),
                    parts: [at, at + octets],
                    ahead: 2 * octets,
                };
                let to = Rows {
                    table: &plan.steps,
                    stride: 2 * octets,
                    parts: [v, v + octets],
                    ahead: WRITTEN,
                };
                let transform = Transform {
                    plan: &plan.time,
                    source: self.spectrum,
                    from: from.exchanged(),
                    target: out,
                    to: to.exchanged(),
                    scratch: self.scratch,
                };
                plan.isa.run(octets, transform);
            }
        }
    }
}

/// Computes one column of the weights' spectra, `[block of maps_out, time frequency, maps_in, 2, block's octets]`.
pub(crate) fn weight_spectrum(
    plan: &Plan,
    column: usize,
    taps: &[Octet],
    spectrum: &mut [Octet],
    scratch: &mut [Octet],
) {
    let [kernel_steps, kernel_taxels] = plan.shape.kernel;
    let (maps_in, outs, group) = (plan.shape.maps_in, plan.outs, plan.out_group);
    let mut lags = Octets::zeros(2 * kernel_steps * group);
    for (kernel, taps) in taps
        .chunks_exact(kernel_steps * kernel_taxels * group)
        .enumerate()
    {
        let rows = KernelRows {
            plan: &plan.taxel,
            column,
            taps,
            lags: &mut lags,
        };
        plan.isa.run(outs, rows);
        let block = plan.out_block;
        let span = plan.time.length() * plan.weight_stride();
        let at = in_blocks(kernel / maps_in * group, block, span) + kernel % maps_in * 2 * block;
        let from = Rows {
            table: &plan.taps,
            stride: 2 * group,
            parts: [0, group],
            ahead: NOTHING,
        };
        let to = Rows {
            table: plan.wanted(column),
            stride: plan.weight_stride(),
            parts: [at, at + block],
            ahead: WRITTEN,
        };
        plan.isa.run(
            outs,
            Transform {
                plan: &plan.time,
                source: &lags,
                from,
                target: spectrum,
                to,
                scratch,
            },
        );
    }
}
