//! Batch normalisation with ReLU as one differentiable operation of Burn's Flex backend.
//!
//! Composed of Burn's operations it would read memory about twelve times, forward and backward; this operation reads it twice each.

use std::fmt;

use burn::backend::Autodiff;
use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{
    AutodiffBackend, Backend, Dispatch, ExtensionType, Flex, TensorMetadata, backend_extension,
};
use burn::tensor::activation::relu;
use burn::tensor::module::batch_norm_train;
use burn::tensor::{Tensor, TensorData};
use pulp::NullaryFnOnce;
use rayon::prelude::*;
use tactnet_conv::spare;

use crate::block::NORM_EPSILON;
use crate::conv::{Primitive, in_order, is_cpu, reclaim, slice};

/// Number of values from which this operation is used; a batch of the dense layer behind the features is smaller.
const LARGE: usize = 1 << 16;
/// Number of values per task, which fit into a core's private cache. Partial sums are added in task order, independent of the threads.
const TASK: usize = 1 << 14;

/// Normalised, rectified rows and the statistics that normalised them.
pub(crate) struct Normalized {
    /// `[rows, channels]`
    pub(crate) output: Tensor<2>,
    /// `[channels]`, detached from the graph
    pub(crate) mean: Tensor<1>,
    /// `[channels]`, biased, detached from the graph
    pub(crate) variance: Tensor<1>,
}

/// Returns `relu(gamma (x - mean) / sqrt(variance + epsilon) + beta)` of `[rows, channels]`, with mean and variance over the rows.
pub(crate) fn norm_relu(input: Tensor<2>, gamma: Tensor<1>, beta: Tensor<1>) -> Normalized {
    if is_cpu(&input.device()) && input.shape().num_elements() >= LARGE {
        return fused(input, gamma, beta);
    }
    let found = batch_norm_train(input, gamma, beta, NORM_EPSILON);
    Normalized {
        output: relu(found.output),
        mean: found.mean,
        variance: found.variance,
    }
}

fn fused(input: Tensor<2>, gamma: Tensor<1>, beta: Tensor<1>) -> Normalized {
    let found = <Dispatch as NormRelu>::norm_relu(
        input.into_dispatch(),
        gamma.into_dispatch(),
        beta.into_dispatch(),
    );
    Normalized {
        output: Tensor::from_dispatch(found.output),
        mean: Tensor::from_dispatch(found.mean),
        variance: Tensor::from_dispatch(found.variance),
    }
}

/// Result of [`NormRelu::norm_relu`]; shapes as in [`Normalized`].
#[derive(ExtensionType)]
pub struct NormReluOutput<B: Backend> {
    pub(crate) output: FloatTensor<B>,
    pub(crate) mean: FloatTensor<B>,
    pub(crate) variance: FloatTensor<B>,
}

/// Backends that normalise and rectify with one operation.
#[backend_extension(Flex, Autodiff)]
pub trait NormRelu: Backend {
    /// See [`norm_relu`].
    fn norm_relu(
        input: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
    ) -> NormReluOutput<Self>;
}

fn tensor<const D: usize>(values: Vec<f32>, extents: [usize; D]) -> Primitive {
    Primitive::from_data(TensorData::new(values, extents))
}

/// Values that the backward pass needs.
#[derive(Clone)]
struct State {
    /// `[rows, channels]`, before normalisation
    input: Primitive,
    /// `[channels]` each: statistics over the rows.
    mean: Vec<f32>,
    inverse_deviation: Vec<f32>,
    /// `[channels]` each: the output is `relu(scale x + shift)`.
    scale: Vec<f32>,
    shift: Vec<f32>,
}

impl fmt::Debug for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("State").field(&self.mean.len()).finish()
    }
}

impl State {
    /// Returns the normalised value, and the gradient if the output is positive, else 0.
    #[inline(always)]
    fn at(&self, channel: usize, value: f32, gradient: f32) -> (f32, f32) {
        let normal = (value - self.mean[channel]) * self.inverse_deviation[channel];
        let passes = value * self.scale[channel] + self.shift[channel] > 0.0;
        (normal, if passes { gradient } else { 0.0 })
    }
}

/// Computation of row count, mean and squared deviations of each channel, for one task.
struct Moments<'a> {
    part: &'a [f32],
    channels: usize,
}

impl NullaryFnOnce for Moments<'_> {
    type Output = (usize, Vec<f32>, Vec<f32>);

    #[inline(always)]
    fn call(self) -> Self::Output {
        let Self { part, channels } = self;
        let rows = part.len() / channels;
        let mut mean = vec![0.0f32; channels];
        for row in part.chunks_exact(channels) {
            mean.iter_mut().zip(row).for_each(|(m, x)| *m += x);
        }
        let share = 1.0 / rows as f32;
        mean.iter_mut().for_each(|m| *m *= share);
        let mut squares = vec![0.0f32; channels];
        for row in part.chunks_exact(channels) {
            for ((s, x), m) in squares.iter_mut().zip(row).zip(&mean) {
                *s += (x - m) * (x - m);
            }
        }
        (rows, mean, squares)
    }
}

/// Computation of `relu(scale x + shift)`.
struct Affine<'a> {
    values: &'a [f32],
    scale: &'a [f32],
    shift: &'a [f32],
    output: &'a mut [f32],
}

impl NullaryFnOnce for Affine<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let channels = self.scale.len();
        let rows = self.output.chunks_exact_mut(channels);
        for (output, row) in rows.zip(self.values.chunks_exact(channels)) {
            let factors = self.scale.iter().zip(self.shift);
            for ((y, x), (scale, shift)) in output.iter_mut().zip(row).zip(factors) {
                let value = x * scale + shift;
                // This comparison keeps NaN, which `max` would replace by 0.
                *y = if value < 0.0 { 0.0 } else { value };
            }
        }
    }
}

/// Computation of the gradients of gamma and beta.
struct Sums<'a> {
    state: &'a State,
    gradient: &'a [f32],
    values: &'a [f32],
}

impl NullaryFnOnce for Sums<'_> {
    type Output = [Vec<f32>; 2];

    #[inline(always)]
    fn call(self) -> Self::Output {
        let channels = self.state.mean.len();
        let (mut dgamma, mut dbeta) = (vec![0.0f32; channels], vec![0.0f32; channels]);
        let rows = self.gradient.chunks_exact(channels);
        for (gradient, row) in rows.zip(self.values.chunks_exact(channels)) {
            let sums = dgamma.iter_mut().zip(&mut dbeta);
            for (c, (dgamma, dbeta)) in sums.enumerate() {
                let (normal, g) = self.state.at(c, row[c], gradient[c]);
                *dbeta += g;
                *dgamma += g * normal;
            }
        }
        [dgamma, dbeta]
    }
}

/// Computation of the gradient of the input.
struct OfInput<'a> {
    state: &'a State,
    gradient: &'a [f32],
    values: &'a [f32],
    sums: [&'a [f32]; 2],
    share: f32,
    input: &'a mut [f32],
}

impl NullaryFnOnce for OfInput<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let channels = self.state.mean.len();
        let [dgamma, dbeta] = self.sums;
        let rows = self.gradient.chunks_exact(channels);
        let rows = rows.zip(self.values.chunks_exact(channels));
        for (input, (gradient, row)) in self.input.chunks_exact_mut(channels).zip(rows) {
            for (c, input) in input.iter_mut().enumerate() {
                let (normal, g) = self.state.at(c, row[c], gradient[c]);
                *input = self.state.scale[c] * (g - (dbeta[c] + normal * dgamma[c]) * self.share);
            }
        }
    }
}

/// Returns mean and biased variance of each channel.
fn moments(values: &[f32], channels: usize) -> (Vec<f32>, Vec<f32>) {
    let run = (TASK / channels).max(1) * channels;
    // Each part has its own mean, and squared deviations from that mean.
    let parts: Vec<(usize, Vec<f32>, Vec<f32>)> = values
        .par_chunks(run)
        .map(|part| pulp::Arch::new().dispatch(Moments { part, channels }))
        .collect();
    let all = (values.len() / channels) as f64;
    let mean: Vec<f64> = (0..channels)
        .map(|c| {
            let sums = parts
                .iter()
                .map(|(rows, mean, _)| *rows as f64 * f64::from(mean[c]));
            sums.sum::<f64>() / all
        })
        .collect();
    let variance = (0..channels)
        .map(|c| {
            let squares = parts.iter().map(|(rows, own, squares)| {
                f64::from(squares[c]) + *rows as f64 * (f64::from(own[c]) - mean[c]).powi(2)
            });
            (squares.sum::<f64>() / all) as f32
        })
        .collect();
    (mean.into_iter().map(|m| m as f32).collect(), variance)
}

fn forward(input: Primitive, gamma: Primitive, beta: Primitive) -> (NormReluOutput<Flex>, State) {
    let [input, gamma, beta] = [input, gamma, beta].map(in_order);
    let extents: [usize; 2] = input.shape().dims();
    let channels = extents[1];
    let (mean, variance) = moments(slice(&input), channels);
    let inverse_deviation: Vec<f32> = variance
        .iter()
        .map(|v| 1.0 / (v + NORM_EPSILON as f32).sqrt())
        .collect();
    let (gamma, beta) = (slice(&gamma), slice(&beta));
    let scale: Vec<f32> = gamma
        .iter()
        .zip(&inverse_deviation)
        .map(|(g, i)| g * i)
        .collect();
    let shift: Vec<f32> = (0..channels)
        .map(|c| beta[c] - mean[c] * scale[c])
        .collect();
    let values = slice(&input);
    let mut output = spare::take(values.len());
    let run = (TASK / channels).max(1) * channels;
    output
        .par_chunks_mut(run)
        .zip(values.par_chunks(run))
        .for_each(|(output, values)| {
            pulp::Arch::new().dispatch(Affine {
                values,
                scale: &scale,
                shift: &shift,
                output,
            });
        });
    let found = NormReluOutput {
        output: tensor(output, extents),
        mean: tensor(mean.clone(), [channels]),
        variance: tensor(variance, [channels]),
    };
    let state = State {
        input,
        mean,
        inverse_deviation,
        scale,
        shift,
    };
    (found, state)
}

impl NormRelu for Flex {
    fn norm_relu(input: Primitive, gamma: Primitive, beta: Primitive) -> NormReluOutput<Self> {
        let (found, state) = forward(input, gamma, beta);
        reclaim(state.input);
        found
    }
}

/// Returns the gradients of input, gamma and beta.
///
/// With `x'` the normalised input and `g` the gradient where the output is positive: `dgamma = sum g x'`, `dbeta = sum g`,
/// `dx = gamma / deviation (g - dbeta / rows - x' dgamma / rows)`.
fn backward(state: &State, gradient: &[f32]) -> [Vec<f32>; 3] {
    let channels = state.mean.len();
    let values = slice(&state.input);
    let run = (TASK / channels).max(1) * channels;
    let parts: Vec<[Vec<f32>; 2]> = gradient
        .par_chunks(run)
        .zip(values.par_chunks(run))
        .map(|(gradient, values)| {
            pulp::Arch::new().dispatch(Sums {
                state,
                gradient,
                values,
            })
        })
        .collect();
    let [dgamma, dbeta] = [0, 1].map(|which: usize| -> Vec<f32> {
        (0..channels)
            .map(|c| {
                parts
                    .iter()
                    .map(|part| f64::from(part[which][c]))
                    .sum::<f64>() as f32
            })
            .collect()
    });
    let share = channels as f32 / values.len() as f32;
    let mut input = spare::take(values.len());
    input
        .par_chunks_mut(run)
        .zip(gradient.par_chunks(run).zip(values.par_chunks(run)))
        .for_each(|(input, (gradient, values))| {
            pulp::Arch::new().dispatch(OfInput {
                state,
                gradient,
                values,
                sums: [&dgamma, &dbeta],
                share,
                input,
            });
        });
    [input, dgamma, dbeta]
}

#[derive(Debug)]
struct NormReluBackward;

impl Backward<Flex, 3> for NormReluBackward {
    type State = State;

    fn backward(
        self,
        ops: Ops<Self::State, 3>,
        gradients: &mut Gradients,
        _checkpointer: &mut Checkpointer,
    ) {
        let extents: [usize; 2] = ops.state.input.shape().dims();
        let gradient = in_order(gradients.consume::<Flex>(&ops.node));
        let [input, gamma, beta] = backward(&ops.state, slice(&gradient));
        reclaim(gradient);
        reclaim(ops.state.input);
        let found = [
            tensor(input, extents),
            tensor(gamma, [extents[1]]),
            tensor(beta, [extents[1]]),
        ];
        for (node, gradient) in ops.parents.into_iter().zip(found) {
            if let Some(node) = node {
                gradients.register::<Flex>(node.id, gradient);
            }
        }
    }
}

impl<C: CheckpointStrategy> NormRelu for Autodiff<Flex, C> {
    fn norm_relu(
        input: FloatTensor<Self>,
        gamma: FloatTensor<Self>,
        beta: FloatTensor<Self>,
    ) -> NormReluOutput<Self> {
        let nodes = [input.node(), gamma.node(), beta.node()];
        let [input, gamma, beta] = [input, gamma, beta].map(|tensor| tensor.into_primitive());
        let (found, state) = forward(input, gamma, beta);
        let output = match NormReluBackward
            .prepare::<C>(nodes)
            .compute_bound()
            .stateful()
        {
            OpsKind::Tracked(prepared) => prepared.finish(state, found.output),
            OpsKind::UnTracked(prepared) => prepared.finish(found.output),
        };
        NormReluOutput {
            output,
            mean: Self::from_inner(found.mean),
            variance: Self::from_inner(found.variance),
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Distribution};

    use super::*;
    use crate::values;

    /// Returns output, statistics and gradients, by this operation and by Burn's.
    fn both_ways(rows: usize, channels: usize, offset: f64) -> [Vec<Vec<f32>>; 2] {
        let device = Device::flex().autodiff();
        let draw = |extents: [usize; 2]| {
            Tensor::<2>::random(extents, Distribution::Uniform(-1.0, 1.0), &device)
        };
        let x = draw([rows, channels]) * 3.0 + offset;
        let (gamma, beta) = (
            draw([1, channels]).flatten::<1>(0, 1) + 1.0,
            draw([1, channels]).flatten::<1>(0, 1),
        );
        // Values so close to zero may have another sign after rounding, and with it another gradient: they do not count.
        let normalised = batch_norm_train(x.clone(), gamma.clone(), beta.clone(), NORM_EPSILON);
        let counts = normalised.output.abs().greater_elem(1e-4).float();
        let weights = draw([rows, channels]) * counts;
        [true, false].map(|ours| {
            let inputs = (
                x.clone().require_grad(),
                gamma.clone().require_grad(),
                beta.clone().require_grad(),
            );
            let (output, mean, variance) = if ours {
                let found = fused(inputs.0.clone(), inputs.1.clone(), inputs.2.clone());
                (found.output, found.mean, found.variance)
            } else {
                let found = batch_norm_train(
                    inputs.0.clone(),
                    inputs.1.clone(),
                    inputs.2.clone(),
                    NORM_EPSILON,
                );
                (relu(found.output), found.mean, found.variance)
            };
            let gradients = (output.clone() * weights.clone()).sum().backward();
            vec![
                values(output.inner()),
                values(mean.without_autodiff()),
                values(variance.without_autodiff()),
                values(inputs.0.grad(&gradients).unwrap()),
                values(inputs.1.grad(&gradients).unwrap()),
                values(inputs.2.grad(&gradients).unwrap()),
            ]
        })
    }

    #[test]
    fn output_statistics_and_gradients_are_those_of_burn() {
        for (rows, channels, offset) in [
            (36, 512, 0.0),
            (2, 3, 0.0),
            (7000, 5, 2.0),
            (1000, 33, 30.0),
        ] {
            let [ours, burns] = both_ways(rows, channels, offset);
            for (which, (ours, burns)) in ours.iter().zip(&burns).enumerate() {
                // Gradients of two rows cancel almost completely; their rounding does not.
                let scale = burns.iter().fold(1e-2_f32, |m, v| m.max(v.abs()));
                for (a, b) in ours.iter().zip(burns) {
                    let near = (a - b).abs() < 2e-4 * scale;
                    assert!(near, "{rows} x {channels}, {which}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn threads_change_no_bit() {
        let device = Device::flex();
        let x = Tensor::<2>::random([5000, 32], Distribution::Uniform(-1.0, 1.0), &device);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let ones = Tensor::ones([32], &device);
            let found = pool
                .unwrap()
                .install(|| fused(x.clone(), ones.clone(), ones.clone()));
            let bits = values(found.output).into_iter().map(f32::to_bits);
            bits.collect::<Vec<_>>()
        };
        assert_eq!(on(1), on(2));
        assert_eq!(on(1), on(4));
    }
}
