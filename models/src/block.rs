//! One convolution block of TactNet-II: convolution, batch normalisation, ReLU, max-pool over time.

use burn::module::{Module, Param};
use burn::tensor::activation::relu;
use burn::tensor::module::{batch_norm, batch_norm_train, conv2d, max_pool2d};
use burn::tensor::ops::{ConvOptions, MaxPoolOptions};
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::conv::{self, TrainedBlock};
use crate::initial::{constant_parameter, uniform_parameter};
use crate::values::values;

/// Added to the variance before the square root in every batch normalisation.
pub const NORM_EPSILON: f64 = 1e-5;
/// Weight of the latest batch in the running statistics.
pub(crate) const NORM_MOMENTUM: f64 = 0.1;

/// Mean and variance of each map over one batch, detached from the autodiff graph.
#[derive(Debug, Clone)]
pub struct BatchStatistics {
    /// `[maps]`
    pub mean: Tensor<1>,
    /// `[maps]`, unbiased (divided by n - 1), as running statistics store it.
    pub variance: Tensor<1>,
}

impl BatchStatistics {
    /// Converts the biased variance of `count` values per map.
    pub(crate) fn from_biased(mean: Tensor<1>, variance: Tensor<1>, count: usize) -> Self {
        let bessel = if count > 1 {
            count as f64 / (count as f64 - 1.0)
        } else {
            1.0
        };
        Self {
            mean: mean.without_autodiff(),
            variance: variance.without_autodiff().mul_scalar(bessel),
        }
    }
}

/// Returns `(1 - momentum) running + momentum batch`.
pub(crate) fn updated_running_stat(running: &Tensor<1>, batch: Tensor<1>) -> Tensor<1> {
    let batch = if running.device().is_autodiff() {
        batch.autodiff()
    } else {
        batch
    };
    running.clone().mul_scalar(1.0 - NORM_MOMENTUM) + batch.mul_scalar(NORM_MOMENTUM)
}

/// Sizes of one convolution block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockConfig {
    /// Number of input maps.
    pub maps_in: usize,
    /// Number of output maps.
    pub maps_out: usize,
    /// Kernel size, time steps by taxels; both are odd.
    pub kernel: [usize; 2],
    /// Number of steps in one pooled step.
    pub pool: usize,
}

/// Convolution, batch normalisation, ReLU and max-pool over time: `[batch, steps, taxels, maps_in]` to
/// `[batch, ceil(steps / pool), taxels, maps_out]`.
///
/// The convolution pads with zeros to the same size and has no bias, since batch normalisation follows.
/// Statistics cover batch, time and taxels. The last pooled step covers the remaining steps.
///
/// On the CPU the block is one operation of `tactnet-conv`, on a GPU one of `tactnet-conv-gpu`; otherwise Burn's operations compose it.
///
/// Source: Tulbure & Bäuml, Humanoids 2018, figure 4.
#[derive(Module, Debug)]
pub struct ConvBlock {
    /// `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub(crate) weight: Param<Tensor<4>>,
    /// `[maps_out]`
    pub(crate) gamma: Param<Tensor<1>>,
    /// `[maps_out]`
    pub(crate) beta: Param<Tensor<1>>,
    /// `[maps_out]`, not trained
    pub(crate) running_mean: Tensor<1>,
    /// `[maps_out]`, not trained
    pub(crate) running_variance: Tensor<1>,
    pub(crate) pool: usize,
}

impl ConvBlock {
    pub(crate) fn init(
        config: BlockConfig,
        first_id: u64,
        device: &Device,
        rng: &mut impl Rng,
    ) -> Self {
        let [time, taxels] = config.kernel;
        let shape = [config.maps_out, config.maps_in, time, taxels];
        Self {
            weight: uniform_parameter(first_id, shape, config.maps_in * time * taxels, device, rng),
            gamma: constant_parameter(first_id + 1, 1.0, [config.maps_out], device),
            beta: constant_parameter(first_id + 2, 0.0, [config.maps_out], device),
            running_mean: Tensor::zeros([config.maps_out], device),
            running_variance: Tensor::ones([config.maps_out], device),
            pool: config.pool,
        }
    }

    /// Runs the block with the statistics of this batch and returns the output and these statistics.
    pub fn forward_train(&self, input: Tensor<4>) -> (Tensor<4>, BatchStatistics) {
        let [batch, steps, taxels, _] = input.dims();
        let found = if conv::is_fused(&input.device()) {
            let (gamma, beta) = (self.gamma.val(), self.beta.val());
            conv::block_train(input, self.weight.val(), gamma, beta, self.pool)
        } else {
            self.train_by_operations(input)
        };
        let count = batch * steps * taxels;
        let statistics = BatchStatistics::from_biased(found.mean, found.variance, count);
        (found.pooled, statistics)
    }

    /// Runs the block with fixed running statistics; differentiable if the device is.
    pub fn forward(&self, input: Tensor<4>) -> Tensor<4> {
        let device = input.device();
        let norm = [
            self.gamma.val(),
            self.beta.val(),
            self.running_mean.clone(),
            self.running_variance.clone(),
        ];
        if conv::is_fused(&device) && !device.is_autodiff() {
            conv::block_eval(input, self.weight.val(), norm, self.pool)
        } else {
            let [gamma, beta, mean, variance] = norm;
            let maps = self.convolve(input);
            self.pool(batch_norm(maps, gamma, beta, mean, variance, NORM_EPSILON))
        }
    }

    /// Runs the block with Burn's operations, for devices without the fused block.
    fn train_by_operations(&self, input: Tensor<4>) -> TrainedBlock {
        let maps = self.convolve(input);
        let normalized = batch_norm_train(maps, self.gamma.val(), self.beta.val(), NORM_EPSILON);
        TrainedBlock {
            pooled: self.pool(normalized.output),
            mean: normalized.mean,
            variance: normalized.variance,
        }
    }

    /// Convolves `[batch, steps, taxels, maps_in]` to `[batch, maps_out, steps, taxels]`.
    fn convolve(&self, input: Tensor<4>) -> Tensor<4> {
        let [_, _, time, taxels] = self.weight.dims();
        let options = ConvOptions::new([1, 1], [time / 2, taxels / 2], [1, 1], 1);
        conv2d(
            input.permute([0, 3, 1, 2]),
            self.weight.val(),
            None,
            options,
        )
    }

    /// Pools `[batch, maps, steps, taxels]` to `[batch, pooled steps, taxels, maps]`.
    fn pool(&self, normalized: Tensor<4>) -> Tensor<4> {
        let mut options = MaxPoolOptions::new([self.pool, 1]);
        options.ceil_mode = !normalized.dims()[2].is_multiple_of(self.pool);
        max_pool2d(relu(normalized), options).permute([0, 2, 3, 1])
    }

    /// Returns scale and shift of the normalisation with running statistics, `[maps_out]` each: `scale * map + shift`.
    pub(crate) fn folded_norm(&self) -> (Vec<f32>, Vec<f32>) {
        let scale = self.gamma.val() / (self.running_variance.clone() + NORM_EPSILON).sqrt();
        let shift = self.beta.val() - self.running_mean.clone() * scale.clone();
        (values(scale), values(shift))
    }

    pub(crate) fn update_running_stats(&mut self, batch: &BatchStatistics) {
        self.running_mean = updated_running_stat(&self.running_mean, batch.mean.clone());
        self.running_variance =
            updated_running_stat(&self.running_variance, batch.variance.clone());
    }
}
