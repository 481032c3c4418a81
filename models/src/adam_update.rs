//! Adam's update as one operation of Burn's Flex and CubeCL backends.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, ExtensionType, Flex, TensorMetadata, backend_extension};
use burn::tensor::Tensor;
use tactnet_conv::AdamStep;

use crate::conv::{in_order, reclaim};

/// Applies one Adam step to `[parameter, gradient, first moment, second moment]` and returns the new parameter and moments.
///
/// All tensors have one shape and lie on a device with fused operations ([`crate::is_fused`]).
/// A tensor that is not shared is updated in place; a shared one is copied first.
pub fn adam_update<const D: usize>(step: AdamStep, tensors: [Tensor<D>; 4]) -> [Tensor<D>; 3] {
    let [parameter, gradient, first, second] = tensors.map(Tensor::into_dispatch);
    let found = <Dispatch as AdamUpdate>::adam_update(parameter, gradient, first, second, step);
    [found.parameter, found.first, found.second].map(Tensor::from_dispatch)
}

/// Result of [`AdamUpdate::adam_update`].
#[derive(ExtensionType)]
pub struct AdamOutput<B: Backend> {
    pub(crate) parameter: FloatTensor<B>,
    pub(crate) first: FloatTensor<B>,
    pub(crate) second: FloatTensor<B>,
}

/// Backends that run an Adam step as one operation.
#[backend_extension(Flex, Cube: cfg(any(feature = "vulkan", feature = "cuda")))]
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
        step.update(
            &mut parameter.storage_mut::<f32>()[..len],
            &gradient.storage::<f32>()[..len],
            [
                &mut first.storage_mut::<f32>()[..len],
                &mut second.storage_mut::<f32>()[..len],
            ],
        );
        reclaim(gradient);
        AdamOutput {
            parameter,
            first,
            second,
        }
    }
}
