//! Values of a tensor in memory of the program.

use burn::tensor::Tensor;

/// Returns a tensor's values in row-major order; copies them only if they are shared.
pub fn values<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor
        .into_data_as::<f32>()
        .try_into_vec::<f32>()
        .unwrap_or_else(|error| panic!("was converted to f32: {error:?}"))
}
