//! Fully connected layer with batch normalisation and ReLU.

use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::module::batch_norm;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::DenseWeights;
use crate::block::{BatchStatistics, NORM_EPSILON, updated_running_stat};
use crate::dense_product::dense_product;
use crate::initial::{constant_parameter, uniform_parameter};
use crate::norm_relu::norm_relu;
use crate::values::values;

/// `relu(batch_norm(x W^T))`: `[batch, inputs] -> [batch, outputs]`; no bias, since batch normalisation follows.
#[derive(Module, Debug)]
pub struct NormalizedDense {
    /// `[outputs, inputs]`
    pub(crate) weight: Param<Tensor<2>>,
    /// `[outputs]`
    pub(crate) gamma: Param<Tensor<1>>,
    /// `[outputs]`
    pub(crate) beta: Param<Tensor<1>>,
    /// `[outputs]`, not trained
    pub(crate) running_mean: Tensor<1>,
    /// `[outputs]`, not trained
    pub(crate) running_variance: Tensor<1>,
}

impl NormalizedDense {
    pub(crate) fn init(
        inputs: usize,
        outputs: usize,
        first_id: u64,
        device: &Device,
        rng: &mut impl Rng,
    ) -> Self {
        Self {
            weight: uniform_parameter(first_id, [outputs, inputs], inputs, device, rng),
            gamma: constant_parameter(first_id + 1, 1.0, [outputs], device),
            beta: constant_parameter(first_id + 2, 0.0, [outputs], device),
            running_mean: Tensor::zeros([outputs], device),
            running_variance: Tensor::ones([outputs], device),
        }
    }

    /// Runs the layer with the statistics of this batch and returns the output and these statistics.
    pub fn forward_train(&self, input: Tensor<2>) -> (Tensor<2>, BatchStatistics) {
        let batch = input.dims()[0];
        let activation = dense_product(input, self.weight.val());
        let normalized = norm_relu(activation, self.gamma.val(), self.beta.val());
        let statistics = BatchStatistics::from_biased(normalized.mean, normalized.variance, batch);
        (normalized.output, statistics)
    }

    /// Runs the layer with the running statistics.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        relu(batch_norm(
            dense_product(input, self.weight.val()),
            self.gamma.val(),
            self.beta.val(),
            self.running_mean.clone(),
            self.running_variance.clone(),
            NORM_EPSILON,
        ))
    }

    /// Returns weights and bias with the running statistics folded in: `relu(weight x + bias)` is the same layer.
    pub(crate) fn folded(&self) -> DenseWeights {
        let scale = self.gamma.val() / (self.running_variance.clone() + NORM_EPSILON).sqrt();
        let bias = self.beta.val() - self.running_mean.clone() * scale.clone();
        DenseWeights {
            weight: values(self.weight.val() * scale.unsqueeze_dim(1)),
            bias: values(bias),
        }
    }

    pub(crate) fn update_running_stats(&mut self, batch: &BatchStatistics) {
        self.running_mean = updated_running_stat(&self.running_mean, batch.mean.clone());
        self.running_variance =
            updated_running_stat(&self.running_variance, batch.variance.clone());
    }
}
