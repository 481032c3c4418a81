//! One step of Adam as one operation of Burn's Flex backend: parameter and moments are changed where they lie.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, ExtensionType, Flex, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::conv::{in_order, reclaim};

/// Values that one task updates.
const RUN: usize = 1 << 14;

/// Adam (Kingma & Ba, 2015) with an L2 penalty added to the gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AdamStep {
    /// Weight of the L2 penalty.
    pub l2: f32,
    /// Decay of the first and of the second moment.
    pub beta: [f32; 2],
    /// Learning rate, times `sqrt(1 - beta_2^t) / (1 - beta_1^t)`.
    pub rate: f32,
    /// Added to the second moment's root, times `sqrt(1 - beta_2^t)`.
    pub epsilon: f32,
}

/// Returns the parameter and both moments after a step from `[parameter, gradient, first moment, second moment]`, all of one shape and on the
/// processor ([`crate::is_cpu`]).
///
/// Tensors that are not shared are changed in place, the others copied first.
pub fn adam_update<const D: usize>(step: AdamStep, tensors: [Tensor<D>; 4]) -> [Tensor<D>; 3] {
    let [parameter, gradient, first, second] = tensors.map(Tensor::into_dispatch);
    let found = <Dispatch as AdamUpdate>::adam_update(parameter, gradient, first, second, step);
    [found.parameter, found.first, found.second].map(Tensor::from_dispatch)
}

/// Result of [`AdamUpdate::adam_update`].
#[derive(ExtensionType)]
pub struct AdamOutput<B: Backend> {
    parameter: FloatTensor<B>,
    first: FloatTensor<B>,
    second: FloatTensor<B>,
}

/// Backends that take the step as one operation.
#[backend_extension(Flex)]
pub trait AdamUpdate: Backend {
    /// See [`adam_update`].
    fn adam_update(
        parameter: FloatTensor<Self>,
        gradient: FloatTensor<Self>,
        first: FloatTensor<Self>,
        second: FloatTensor<Self>,
        step: AdamStep,
    ) -> AdamOutput<Self>;
}

type Primitive = FloatTensor<Flex>;

impl AdamUpdate for Flex {
    fn adam_update(
        parameter: Primitive,
        gradient: Primitive,
        first: Primitive,
        second: Primitive,
        step: AdamStep,
    ) -> AdamOutput<Self> {
        let len = parameter.shape().num_elements();
        let gradient = in_order(gradient);
        let [mut parameter, mut first, mut second] = [parameter, first, second].map(in_order);
        let AdamStep {
            l2,
            beta,
            rate,
            epsilon,
        } = step;
        parameter.storage_mut::<f32>()[..len]
            .par_chunks_mut(RUN)
            .zip(gradient.storage::<f32>()[..len].par_chunks(RUN))
            .zip(first.storage_mut::<f32>()[..len].par_chunks_mut(RUN))
            .zip(second.storage_mut::<f32>()[..len].par_chunks_mut(RUN))
            .for_each(|(((parameter, gradient), first), second)| {
                let moments = first.iter_mut().zip(second);
                for ((parameter, &gradient), (m, v)) in
                    parameter.iter_mut().zip(gradient).zip(moments)
                {
                    let gradient = gradient + l2 * *parameter;
                    *m = beta[0] * *m + (1.0 - beta[0]) * gradient;
                    *v = beta[1] * *v + (1.0 - beta[1]) * gradient * gradient;
                    *parameter -= rate * *m / (v.sqrt() + epsilon);
                }
            });
        reclaim(gradient);
        AdamOutput {
            parameter,
            first,
            second,
        }
    }
}
