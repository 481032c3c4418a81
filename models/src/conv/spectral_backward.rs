//! Gradients of a spectral block, from the spectra that its forward pass kept.
//!
//! With `Y = X W` at every frequency, `dX = dY conj(W)` (over the output maps) and `dW = conj(X) dY` (over the batch). `dy` itself is
//! built row by row from the winners' gradients and the maps, see [`super::norm`], and goes straight into its taxel spectrum.

use rayon::prelude::*;

use super::norm::OutputGradient;
use super::product::Left;
use super::shape::BlockShape;
use super::simd::{NOWHERE, Octet, Rows, floats};
use super::spectral::{SavedSpectral, Spectral};
use super::spectral_plan::Plan;
use super::spectral_stages::{InputGradient, Spread, TurnConjugated, WeightGradient};
use super::taxel::Mirror;

impl Spectral {
    /// Gradients of the weights and, if wanted, of the input.
    pub(super) fn backward(
        &self,
        saved: SavedSpectral,
        output: OutputGradient<'_>,
        need_input: bool,
    ) -> (Vec<f32>, Option<Vec<f32>>) {
        let plan = &self.plan;
        let (shape, columns, length) = (plan.shape, plan.taxel.frequencies(), plan.time.length());
        let row = shape.steps * 2 * plan.outs;
        let mut rows = self.buffers.take(shape.batch * columns * row);
        rows.par_chunks_exact_mut(columns * row)
            .zip(
                saved
                    .maps
                    .par_chunks_exact(shape.steps * shape.taxels * plan.outs),
            )
            .enumerate()
            .for_each(|(sweep, (rows, maps))| {
                let stage = Spread {
                    plan,
                    sweep,
                    output,
                    maps,
                    rows,
                };
                plan.isa.run(plan.outs, stage)
            });
        let inputs = if need_input {
            shape.batch * shape.steps * 2 * plan.ins
        } else {
            0
        };
        let mut d_input = self.buffers.take(columns * inputs.max(1));
        let kernels = shape.maps_in * plan.outs * shape.kernel[0] * 2;
        let mut d_taps = self.buffers.take(columns * kernels);
        d_input
            .par_chunks_exact_mut(inputs.max(1))
            .zip(d_taps.par_chunks_exact_mut(kernels))
            .zip(saved.input.par_chunks_exact(length * plan.input_stride()))
            .zip(saved.weight.par_chunks_exact(length * plan.weight_stride()))
            .enumerate()
            .for_each(|(column, (((d_input, d_taps), input), weight))| {
                let mut buffers = [
                    plan.output_stride(),
                    plan.input_stride(),
                    plan.weight_stride(),
                ]
                .map(|stride| self.buffers.take(length * stride));
                let mut turned = self.buffers.take(shape.maps_out * 2 * plan.ins);
                let mut scratch = self.buffers.take(plan.time.scratch(2));
                let [d_spectrum, d_input_spectrum, d_weight_spectrum] = &mut buffers;
                ColumnBackward {
                    plan,
                    column,
                    rows: &rows,
                    input,
                    weight,
                    d_input: if need_input { d_input } else { &mut [] },
                    d_taps,
                    d_spectrum,
                    d_input_spectrum,
                    d_weight_spectrum,
                    turned: &mut turned,
                    scratch: &mut scratch,
                }
                .run();
                buffers
                    .into_iter()
                    .chain([turned, scratch])
                    .for_each(|buffer| self.buffers.give(buffer));
            });
        let mut weight = vec![0f32; shape.weight_len()];
        weight
            .par_chunks_exact_mut(shape.weight_len() / plan.outs * plan.out_group)
            .enumerate()
            .for_each(|(group, weight)| {
                let stage = WeightGradient {
                    plan,
                    group,
                    d_taps: &d_taps,
                    weight,
                };
                plan.isa.run(plan.outs, stage)
            });
        let input = need_input.then(|| {
            let mut input = vec![0f32; shape.input_len()];
            input
                .par_chunks_exact_mut(shape.input_len() / shape.batch)
                .enumerate()
                .for_each(|(sweep, input)| {
                    let stage = InputGradient {
                        plan,
                        sweep,
                        spectra: &d_input,
                        input,
                    };
                    plan.isa.run(plan.ins, stage)
                });
            input
        });
        self.recycle(saved);
        [rows, d_input, d_taps]
            .into_iter()
            .for_each(|buffer| self.buffers.give(buffer));
        (weight, input)
    }
}

/// One column: time spectrum of `dy`, both products, and back.
struct ColumnBackward<'a> {
    plan: &'a Plan,
    column: usize,
    rows: &'a [Octet],
    input: &'a [Octet],
    weight: &'a [Octet],
    /// `[batch, steps, 2, maps_in]`, empty if not wanted
    d_input: &'a mut [Octet],
    /// `[group of maps_out octets, maps_in, kernel steps, 2]`
    d_taps: &'a mut [Octet],
    d_spectrum: &'a mut [Octet],
    d_input_spectrum: &'a mut [Octet],
    d_weight_spectrum: &'a mut [Octet],
    turned: &'a mut [Octet],
    scratch: &'a mut [Octet],
}

impl ColumnBackward<'_> {
    fn run(self) {
        let plan = self.plan;
        let BlockShape {
            batch,
            steps,
            maps_in,
            maps_out,
            kernel,
            ..
        } = plan.shape;
        let (ins, outs) = (plan.ins, plan.outs);
        let (mirror, wanted) = (plan.taxel.mirror(self.column), plan.wanted(self.column));
        let strides = [
            plan.output_stride(),
            plan.input_stride(),
            plan.weight_stride(),
        ];
        let need_input = !self.d_input.is_empty();
        for sweep in 0..batch {
            let source = &self.rows
                [(sweep * plan.taxel.frequencies() + self.column) * steps * 2 * outs..]
                [..steps * 2 * outs];
            for v in (0..outs).step_by(plan.out_group) {
                let from = Rows {
                    table: &plan.steps,
                    stride: 2 * outs,
                    parts: [v, outs + v],
                };
                let at = sweep * 2 * outs + v;
                let to = Rows {
                    table: wanted,
                    stride: strides[0],
                    parts: [at, at + outs],
                };
                plan.time.run(
                    (plan.isa, outs),
                    (source, from),
                    (self.d_spectrum, to),
                    self.scratch,
                );
            }
        }
        for (s, &row) in wanted.rows().iter().enumerate() {
            if row == NOWHERE {
                continue;
            }
            let dy = &self.d_spectrum[s * strides[0]..][..batch * 2 * outs];
            let x = floats(&self.input[s * strides[1]..][..batch * 2 * ins]);
            let left = Left {
                values: x,
                row: 1,
                inner: 2 * maps_in,
                imaginary: maps_in,
            };
            left.conjugate_times(
                plan.isa,
                dy,
                &mut self.d_weight_spectrum[s * strides[2]..][..maps_in * 2 * outs],
                outs,
            );
            if need_input {
                let weight = &self.weight[s * strides[2]..][..maps_in * 2 * outs];
                plan.isa.run_narrow(TurnConjugated {
                    weight,
                    turned: self.turned,
                    ins,
                    outs,
                });
                let left = Left {
                    values: floats(dy),
                    row: 2 * maps_out,
                    inner: 1,
                    imaginary: maps_out,
                };
                left.times(
                    plan.isa,
                    self.turned,
                    &mut self.d_input_spectrum[s * strides[1]..][..batch * 2 * ins],
                    ins,
                );
            }
        }
        // Products of two spectra of the same kind: the weights' gradient is real in time wherever the column mirrors itself.
        let real = if mirror == Mirror::Imaginary {
            Mirror::Real
        } else {
            mirror
        };
        plan.mirror(real, self.d_weight_spectrum, strides[2], outs);
        let group = plan.out_group;
        for (at, taps) in self
            .d_taps
            .chunks_exact_mut(2 * kernel[0] * group)
            .enumerate()
        {
            let at = at % maps_in * 2 * outs + at / maps_in * group;
            let from = Rows {
                table: &plan.all,
                stride: strides[2],
                parts: [at, at + outs],
            };
            let to = Rows {
                table: &plan.taps,
                stride: 2 * group,
                parts: [0, group],
            };
            plan.time.run(
                (plan.isa, outs),
                (self.d_weight_spectrum, from.exchanged()),
                (taps, to.exchanged()),
                self.scratch,
            );
        }
        if need_input {
            plan.mirror(mirror, self.d_input_spectrum, strides[1], ins);
            for (sweep, out) in self.d_input.chunks_exact_mut(steps * 2 * ins).enumerate() {
                for v in (0..ins).step_by(plan.in_group) {
                    let at = sweep * 2 * ins + v;
                    let from = Rows {
                        table: &plan.all,
                        stride: strides[1],
                        parts: [at, at + ins],
                    };
                    let to = Rows {
                        table: &plan.steps,
                        stride: 2 * ins,
                        parts: [v, ins + v],
                    };
                    plan.time.run(
                        (plan.isa, ins),
                        (self.d_input_spectrum, from.exchanged()),
                        (out, to.exchanged()),
                        self.scratch,
                    );
                }
            }
        }
    }
}
