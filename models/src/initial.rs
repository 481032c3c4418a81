//! Initial parameters from a generator of the caller.

use burn::module::{Param, ParamId};
use burn::tensor::{Device, Tensor, TensorData};
use rand::{Rng, RngExt};

/// Draws values uniformly from `±1 / sqrt(fan_in)`, in `f64` before rounding, so that all devices start from the same numbers.
///
/// Source: LeCun et al., Efficient BackProp (1998), section 4.6; PyTorch's range for linear and convolution layers.
pub(crate) fn uniform_parameter<const D: usize>(
    id: u64,
    shape: [usize; D],
    fan_in: usize,
    device: &Device,
    rng: &mut impl Rng,
) -> Param<Tensor<D>> {
    let bound = 1.0 / (fan_in as f64).sqrt();
    let values: Vec<f32> = (0..shape.iter().product())
        .map(|_| ((rng.random::<f64>() * 2.0 - 1.0) * bound) as f32)
        .collect();
    parameter(
        id,
        Tensor::from_data(TensorData::new(values, shape), device),
    )
}

/// Returns a parameter filled with `value`.
pub(crate) fn constant_parameter<const D: usize>(
    id: u64,
    value: f32,
    shape: [usize; D],
    device: &Device,
) -> Param<Tensor<D>> {
    parameter(id, Tensor::full(shape, value, device))
}

/// Returns a parameter that requires gradients if its device records them. Fixed ids let a restored optimiser find its parameters.
pub(crate) fn parameter<const D: usize>(id: u64, value: Tensor<D>) -> Param<Tensor<D>> {
    let value = if value.device().is_autodiff() {
        value.require_grad()
    } else {
        value
    };
    Param::initialized(ParamId::from(id), value)
}
