//! One column of the backward pass.

use super::plan::{Plan, following};
use super::stages::TurnConjugated;
use crate::fft::Transform;
use crate::product::{Left, Soon};
use crate::shape::BlockShape;
use crate::simd::{NOTHING, NOWHERE, Octet, Rows, WRITTEN, floats};
use crate::taxel::Mirror;

/// Backward pass of one column: for each block of output maps the time spectrum of `dy` and its product with the input; then the product
/// with the weights over all blocks, and the inverse transform.
pub(crate) struct ColumnBackward<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) column: usize,
    pub(crate) rows: &'a [Octet],
    pub(crate) input: &'a [Octet],
    pub(crate) weight: &'a [Octet],
    /// `[block of maps_in, parts, input steps, 2, block's octets]`, empty if not requested
    pub(crate) d_input: &'a mut [Octet],
    /// `[group of maps_out octets, maps_in, kernel steps, 2]`
    pub(crate) d_taps: &'a mut [Octet],
    /// `[block of maps_out, time frequency, parts, 2, block's octets]`
    pub(crate) d_spectrum: &'a mut [Octet],
    /// `[time frequency, parts, 2, maps_in]`
    pub(crate) d_input_spectrum: &'a mut [Octet],
    /// `[time frequency, maps_in, 2, block's octets]`, of one block
    pub(crate) d_weight_spectrum: &'a mut [Octet],
    pub(crate) turned: &'a mut [Octet],
    pub(crate) scratch: &'a mut [Octet],
}

impl ColumnBackward<'_> {
    pub(crate) fn run(mut self) {
        let plan = self.plan;
        for block in 0..plan.out_blocks() {
            self.transform(block);
            self.multiply_with_input(block);
            self.weight_gradient(block);
        }
        if !self.d_input.is_empty() {
            self.multiply_with_weights();
            self.input_gradient();
        }
    }

    /// Computes the time spectrum of a block of `dy`.
    fn transform(&mut self, block: usize) {
        let plan = self.plan;
        let (octets, steps) = (plan.out_block, plan.ranges.span);
        let rows = steps * 2 * octets;
        let stride = plan.output_stride();
        let target = &mut self.d_spectrum[block * plan.time.length() * stride..];
        for part in 0..plan.parts() {
            let at = (part * plan.taxel.frequencies() + self.column) * plan.out_blocks() + block;
            let source = &self.rows[at * rows..][..rows];
            for v in (0..octets).step_by(plan.out_group) {
                let from = Rows {
                    table: &plan.steps,
                    stride: 2 * octets,
                    parts: [v, v + octets],
                    ahead: plan.taxel.frequencies() * plan.out_blocks() * rows,
                };
                let at = part * 2 * octets + v;
                let to = Rows {
                    table: plan.wanted(self.column),
                    stride,
                    parts: [at, at + octets],
                    ahead: WRITTEN,
                };
                plan.isa.run(
                    octets,
                    Transform {
                        plan: &plan.time,
                        source,
                        from,
                        target,
                        to,
                        scratch: self.scratch,
                    },
                );
            }
        }
    }

    /// Computes `conj(X) dY` of a block at all frequencies.
    fn multiply_with_input(&mut self, block: usize) {
        let plan = self.plan;
        let (parts, maps_in) = (plan.parts(), plan.shape.maps_in);
        let octets = plan.out_block;
        let d_spectrum = &self.d_spectrum[block * plan.time.length() * plan.output_stride()..];
        let lefts = self.input.chunks_exact(plan.input_stride());
        let rights = d_spectrum.chunks_exact(plan.output_stride());
        let products = self
            .d_weight_spectrum
            .chunks_exact_mut(plan.weight_stride());
        let nexts = following(lefts.clone()).zip(following(rights.clone()));
        let products = lefts.zip(rights).zip(products).zip(nexts);
        let wanted = plan.wanted(self.column).rows();
        for ((((x, dy), out), next), &row) in products.zip(wanted) {
            if row != NOWHERE {
                let left = Left {
                    values: floats(&x[..parts * 2 * plan.ins]),
                    row: 1,
                    inner: 2 * maps_in,
                    imaginary: maps_in,
                    soon: Soon {
                        left: floats(next.0),
                        right: next.1,
                    },
                };
                left.conjugate_times(
                    plan.isa,
                    &dy[..parts * 2 * octets],
                    &mut out[..maps_in * 2 * octets],
                    octets,
                );
            }
        }
    }

    /// Transforms the product of a block back to taps.
    fn weight_gradient(&mut self, block: usize) {
        let plan = self.plan;
        let BlockShape {
            maps_in, kernel, ..
        } = plan.shape;
        let octets = plan.out_block;
        // A product of two spectra with equal symmetry: in self-mirroring columns the weights' gradient is real in time.
        let real = match plan.taxel.mirror(self.column) {
            Mirror::Imaginary => Mirror::Real,
            mirror => mirror,
        };
        plan.mirror(real, self.d_weight_spectrum, plan.weight_stride(), octets);
        let group = plan.out_group;
        let taps = 2 * kernel[0] * group;
        let first = block * octets / group * maps_in;
        let kernels = self.d_taps.chunks_exact_mut(taps).skip(first);
        for (at, taps) in kernels.take(octets / group * maps_in).enumerate() {
            let at = at % maps_in * 2 * octets + at / maps_in * group;
            let from = Rows {
                table: &plan.all,
                stride: plan.weight_stride(),
                parts: [at, at + octets],
                ahead: 2 * octets,
            };
            let to = Rows {
                table: &plan.taps,
                stride: 2 * group,
                parts: [0, group],
                ahead: NOTHING,
            };
            plan.isa.run(
                octets,
                Transform {
                    plan: &plan.time,
                    source: self.d_weight_spectrum,
                    from: from.exchanged(),
                    target: taps,
                    to: to.exchanged(),
                    scratch: self.scratch,
                },
            );
        }
    }

    /// Computes `dY conj(W)` over all blocks at all frequencies.
    fn multiply_with_weights(&mut self) {
        let plan = self.plan;
        let (parts, maps_in) = (plan.parts(), plan.shape.maps_in);
        let (ins, octets, length) = (plan.ins, plan.out_block, plan.time.length());
        for (s, &row) in plan.wanted(self.column).rows().iter().enumerate() {
            if row == NOWHERE {
                continue;
            }
            let out = &mut self.d_input_spectrum[s * plan.input_stride()..][..parts * 2 * ins];
            for block in 0..plan.out_blocks() {
                let at = block * length + s;
                let weight = &self.weight[at * plan.weight_stride()..][..maps_in * 2 * octets];
                plan.isa.run_narrow(TurnConjugated {
                    weight,
                    turned: self.turned,
                    ins,
                    outs: octets,
                });
                // The next block, or the first block of the next frequency.
                let next = match block + 1 {
                    next if next < plan.out_blocks() => next * length + s,
                    _ => (s + 1).min(length - 1),
                };
                let dy = &self.d_spectrum[at * plan.output_stride()..][..parts * 2 * octets];
                let left = Left {
                    values: floats(dy),
                    row: 2 * octets * 8,
                    inner: 1,
                    imaginary: octets * 8,
                    soon: Soon {
                        left: floats(&self.d_spectrum[next * plan.output_stride()..]),
                        right: &self.weight[next * plan.weight_stride()..],
                    },
                };
                if block == 0 {
                    left.times(plan.isa, self.turned, out, ins);
                } else {
                    left.times_onto(plan.isa, self.turned, out, ins);
                }
            }
        }
    }

    /// Transforms the product over all blocks back to steps.
    fn input_gradient(&mut self) {
        let plan = self.plan;
        let (parts, seen, ins) = (plan.parts(), plan.ranges.width, plan.ins);
        let mirror = plan.taxel.mirror(self.column);
        plan.mirror(mirror, self.d_input_spectrum, plan.input_stride(), ins);
        let octets = plan.in_block;
        for (at, out) in self.d_input.chunks_exact_mut(seen * 2 * octets).enumerate() {
            let (block, part) = (at / parts, at % parts);
            for v in (0..octets).step_by(plan.in_group) {
                let at = part * 2 * ins + block * octets + v;
                let from = Rows {
                    table: &plan.all,
                    stride: plan.input_stride(),
                    parts: [at, at + ins],
                    ahead: 2 * ins,
                };
                let to = Rows {
                    table: &plan.seen,
                    stride: 2 * octets,
                    parts: [v, v + octets],
                    ahead: WRITTEN,
                };
                plan.isa.run(
                    ins,
                    Transform {
                        plan: &plan.time,
                        source: self.d_input_spectrum,
                        from: from.exchanged(),
                        target: out,
                        to: to.exchanged(),
                        scratch: self.scratch,
                    },
                );
            }
        }
    }
}
