//! Gradients of the spectral route, from the spectra that the forward pass saved.
//!
//! With `Y = X W` at every frequency, `dX = dY conj(W)` (over the output maps) and `dW = conj(X) dY` (over the batch). `dy` is
//! built row by row from the winners' gradients and the maps, see [`super::norm`], and written directly into its taxel spectrum.

use rayon::prelude::*;

use super::norm::OutputGradient;
use super::product::{Left, Soon};
use super::shape::BlockShape;
use super::simd::{NOTHING, NOWHERE, Octet, Rows, WRITTEN, floats};
use super::spare;
use super::spectral::{SavedGroup, SavedSpectral, Spectral};
use super::spectral_plan::{Plan, following};
use super::spectral_stages::{InputGradient, Spread, TurnConjugated, WeightGradient};
use super::taxel::Mirror;

impl Spectral {
    /// Returns the gradients of the weights and, if requested, of the input.
    pub(super) fn backward(
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
        let row = plan.ranges.span * 2 * plan.outs;
        let mut rows = self.buffers.take(plan.parts() * columns * row);
        rows.par_chunks_exact_mut(columns * row)
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
        let mut weight = spare::take(shape.weight_len());
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
        if let Some(target) = target {
            target
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
        }
        [rows, d_input, d_taps]
            .into_iter()
            .for_each(|buffer| self.buffers.give(buffer));
        weight
    }
}

/// Backward pass of one column: for each block of output maps the time spectrum of `dy` and its product with the input; then the product
/// with the weights over all blocks, and the inverse transform.
struct ColumnBackward<'a> {
    plan: &'a Plan,
    column: usize,
    rows: &'a [Octet],
    input: &'a [Octet],
    weight: &'a [Octet],
    /// `[block of maps_in, parts, input steps, 2, block's octets]`, empty if not requested
    d_input: &'a mut [Octet],
    /// `[group of maps_out octets, maps_in, kernel steps, 2]`
    d_taps: &'a mut [Octet],
    /// `[block of maps_out, time frequency, parts, 2, block's octets]`
    d_spectrum: &'a mut [Octet],
    /// `[time frequency, parts, 2, maps_in]`
    d_input_spectrum: &'a mut [Octet],
    /// `[time frequency, maps_in, 2, block's octets]`, of one block
    d_weight_spectrum: &'a mut [Octet],
    turned: &'a mut [Octet],
    scratch: &'a mut [Octet],
}

impl ColumnBackward<'_> {
    fn run(mut self) {
        let plan = self.plan;
        for block in 0..plan.out_blocks() {
            self.transform(block);
            self.weight_gradient(block);
        }
        if !self.d_input.is_empty() {
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
                plan.time.run(
                    (plan.isa, octets),
                    (source, from),
                    (target, to),
                    self.scratch,
                );
            }
        }
    }

    /// Computes `conj(X) dY` of a block and transforms it back to taps.
    fn weight_gradient(&mut self, block: usize) {
        let plan = self.plan;
        let BlockShape {
            maps_in, kernel, ..
        } = plan.shape;
        let parts = plan.parts();
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
            plan.time.run(
                (plan.isa, octets),
                (self.d_weight_spectrum, from.exchanged()),
                (taps, to.exchanged()),
                self.scratch,
            );
        }
    }

    /// Computes `dY conj(W)` over all blocks and transforms it back to steps.
    fn input_gradient(&mut self) {
        let plan = self.plan;
        let (parts, seen, maps_in) = (plan.parts(), plan.ranges.width, plan.shape.maps_in);
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
