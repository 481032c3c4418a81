//! Gradients of the spectral route, from the spectra that the forward pass saved.
//!
//! With `Y = X W` at every frequency, `dX = dY conj(W)` (over the output maps) and `dW = conj(X) dY` (over the batch). `dy` is
//! built row by row from the winners' gradients and the maps, see [`crate::norm`], and written directly into its taxel spectrum.

use rayon::prelude::*;

use super::backward_column::ColumnBackward;
use super::plan::Plan;
use super::stages::{InputGradient, Spread, WeightGradient};
use super::{SavedGroup, SavedSpectral, Spectral};
use crate::norm::OutputGradient;
use crate::simd::{Octet, Octets};
use crate::spare;

impl Spectral {
    /// Returns the gradients of the weights and, if requested, of the input.
    pub(crate) fn backward(
        &self,
        saved: SavedSpectral,
        output: OutputGradient<'_>,
        need_input: bool,
    ) -> (Vec<f32>, Option<Vec<f32>>) {
        let SavedSpectral { weight, groups } = saved;
        let shape = &self.plan.shape;
        let [sweep_in, sweep_out] =
            [shape.input_len(), shape.output_len()].map(|len| len / shape.batch);
        let together = shape.batch;
        let mut d_input =
            need_input.then(|| spare::take(output.gradient.len() / sweep_out * sweep_in));
        let targets: Vec<Option<&mut [f32]>> = match &mut d_input {
            Some(d_input) => d_input.chunks_mut(together * sweep_in).map(Some).collect(),
            None => groups.iter().map(|_| None).collect(),
        };
        let of_groups: Vec<Vec<f32>> = output
            .gradient
            .par_chunks(together * sweep_out)
            .zip(output.positions.par_chunks(together * sweep_out))
            .zip(groups)
            .zip(targets)
            .with_min_len(self.groups_of_thread())
            .map(|(((gradient, positions), group), target)| {
                let plan = self.plan_of(gradient.len(), sweep_out);
                let output = OutputGradient {
                    gradient,
                    positions,
                    affine: output.affine,
                };
                let d_weight = self.backward_group(plan, &weight, &group, output, target);
                self.recycle_group(group);
                d_weight
            })
            .collect();
        let mut of_groups = of_groups.into_iter();
        let mut d_weight = of_groups.next().unwrap_or_default();
        for of_group in of_groups {
            for (sum, value) in d_weight.iter_mut().zip(&of_group) {
                *sum += value;
            }
            spare::give(of_group);
        }
        self.recycle(SavedSpectral {
            weight,
            groups: Vec::new(),
        });
        (d_weight, d_input)
    }

    /// Adds the weights' gradient of a group's sweeps; writes the gradient of their input to `target`.
    fn backward_group(
        &self,
        plan: &Plan,
        weight: &[Octet],
        saved: &SavedGroup,
        output: OutputGradient<'_>,
        target: Option<&mut [f32]>,
    ) -> Vec<f32> {
        let need_input = target.is_some();
        let (shape, columns, length) = (plan.shape, plan.taxel.frequencies(), plan.time.length());
        let rows = self.spread(plan, saved, output);
        let inputs = if need_input {
            plan.parts() * plan.ranges.width * 2 * plan.ins
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
            .zip(weight.par_chunks_exact(plan.weight_column()))
            .enumerate()
            .for_each(|(column, (((d_input, d_taps), input), weight))| {
                let mut buffers = [
                    plan.out_blocks() * plan.output_stride(),
                    plan.input_stride(),
                    plan.weight_stride(),
                ]
                .map(|stride| self.buffers.take(length * stride));
                let mut turned = self.buffers.take(plan.out_block * 8 * 2 * plan.ins);
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
        let weight = weight_gradient(plan, &d_taps);
        if let Some(target) = target {
            input_gradient(plan, &d_input, target);
        }
        [rows, d_input, d_taps]
            .into_iter()
            .for_each(|buffer| self.buffers.give(buffer));
        weight
    }

    /// Returns the taxel spectra of `dy`, `[part, column, block of maps_out, steps, 2, block's octets]`.
    fn spread(&self, plan: &Plan, saved: &SavedGroup, output: OutputGradient<'_>) -> Octets {
        let shape = plan.shape;
        let row = plan.taxel.frequencies() * plan.ranges.span * 2 * plan.outs;
        let mut rows = self.buffers.take(plan.parts() * row);
        rows.par_chunks_exact_mut(row)
            .enumerate()
            .for_each(|(part, rows)| {
                let (sweep, band, range) = plan.place(part);
                let steps = plan.ranges.outputs(range);
                let step = shape.taxels * plan.outs;
                let maps = &saved.maps[(sweep * shape.steps + steps.start) * step..];
                let stage = Spread {
                    plan,
                    sweep,
                    band,
                    range,
                    output,
                    maps: &maps[..steps.len() * step],
                    rows,
                };
                plan.isa.run(plan.outs, stage)
            });
        rows
    }
}

/// Returns the weights' gradient from the gradients of all columns.
fn weight_gradient(plan: &Plan, d_taps: &[Octet]) -> Vec<f32> {
    let shape = plan.shape;
    let mut weight = spare::take(shape.weight_len());
    weight
        .par_chunks_exact_mut(shape.weight_len() / plan.outs * plan.out_group)
        .enumerate()
        .for_each(|(group, weight)| {
            let stage = WeightGradient {
                plan,
                group,
                d_taps,
                weight,
            };
            plan.isa.run(plan.outs, stage)
        });
    weight
}

/// Overwrites `target` with the input's gradient from the gradients of all columns.
fn input_gradient(plan: &Plan, d_input: &[Octet], target: &mut [f32]) {
    let shape = plan.shape;
    target
        .par_chunks_exact_mut(shape.input_len() / shape.batch)
        .enumerate()
        .for_each(|(sweep, input)| {
            let stage = InputGradient {
                plan,
                sweep,
                spectra: d_input,
                input,
            };
            plan.isa.run(plan.ins, stage)
        });
}
