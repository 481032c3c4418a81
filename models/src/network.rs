//! Network: trunk, dropout, normalised dense layer, output layer.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::block::BatchStatistics;
use crate::config::TrunkShape;
use crate::conv_trunk::ConvTrunk;
use crate::dense::NormalizedDense;
use crate::initial::uniform_parameter;
use crate::spectral_trunk::SpectralTrunk;
use crate::{DenseWeights, LinearHead, NetworkConfig};

/// Distance between the first parameter ids of two layers, so that ids do not depend on the size of other layers.
const IDS_PER_LAYER: u64 = 8;

/// Result of a training pass.
pub struct TrainingForward {
    /// `[batch, materials]`
    pub logits: Tensor<2>,
    /// `[batch, hidden]`: input of the output layer.
    pub hidden: Tensor<2>,
    /// Batch statistics of every normalised layer, for [`Network::update_running_stats`].
    pub statistics: Vec<BatchStatistics>,
}

/// Network with any trunk, for sweeps `[batch, 1, steps, taxels]`.
#[derive(Module, Debug)]
pub struct Network {
    pub(crate) trunk: TrunkNet,
    pub(crate) hidden: NormalizedDense,
    /// `[materials, hidden]`
    pub(crate) output_weight: Param<Tensor<2>>,
    /// `[materials]`
    pub(crate) output_bias: Param<Tensor<1>>,
}

/// Layers that extract features. There are few networks, so the difference in size between the variants does not matter.
#[allow(clippy::large_enum_variant)]
#[derive(Module, Debug)]
pub(crate) enum TrunkNet {
    Convolutions(ConvTrunk),
    Spectra(SpectralTrunk),
}

impl TrunkNet {
    fn init(
        config: &NetworkConfig,
        next_id: impl FnMut() -> u64,
        device: &Device,
        rng: &mut impl Rng,
    ) -> Self {
        match config.trunk() {
            TrunkShape::Convolutions(shape) => {
                Self::Convolutions(ConvTrunk::init(shape, next_id, device, rng))
            }
            TrunkShape::Spectra(shape) => {
                Self::Spectra(SpectralTrunk::init(shape, next_id, device, rng))
            }
        }
    }

    fn forward_train(&self, sweeps: Tensor<3>, statistics: &mut Vec<BatchStatistics>) -> Tensor<2> {
        match self {
            Self::Convolutions(trunk) => trunk.forward_train(sweeps, statistics),
            Self::Spectra(trunk) => trunk.forward_train(sweeps, statistics),
        }
    }

    fn forward(&self, sweeps: Tensor<3>) -> Tensor<2> {
        match self {
            Self::Convolutions(trunk) => trunk.forward(sweeps),
            Self::Spectra(trunk) => trunk.forward(sweeps),
        }
    }

    fn normalized_layers(&self) -> usize {
        match self {
            Self::Convolutions(trunk) => trunk.normalized_layers(),
            Self::Spectra(trunk) => trunk.normalized_layers(),
        }
    }

    fn statistics_of(&self, layer: usize, sweeps: Tensor<3>) -> BatchStatistics {
        match self {
            Self::Convolutions(trunk) => trunk.statistics_of(layer, sweeps),
            Self::Spectra(trunk) => trunk.statistics_of(layer, sweeps),
        }
    }

    /// Returns running mean and running variance of a layer.
    fn running_mut(&mut self, layer: usize) -> [&mut Tensor<1>; 2] {
        match self {
            Self::Convolutions(trunk) => {
                let block = &mut trunk.blocks[layer];
                [&mut block.running_mean, &mut block.running_variance]
            }
            Self::Spectra(trunk) => {
                let [taxel, window] = trunk.layers_mut();
                let (_, dense) = if layer == 0 { taxel } else { window };
                [&mut dense.running_mean, &mut dense.running_variance]
            }
        }
    }

    fn update_running_stats(&mut self, statistics: &[BatchStatistics]) {
        match self {
            Self::Convolutions(trunk) => trunk.update_running_stats(statistics),
            Self::Spectra(trunk) => trunk.update_running_stats(statistics),
        }
    }
}

impl Network {
    /// Creates a network with random weights from `rng`; trainable if the device has autodiff.
    pub fn init(config: &NetworkConfig, device: &Device, rng: &mut impl Rng) -> Self {
        let hidden_units = config.architecture().hidden;
        let mut ids = (0..).map(|layer| 1 + layer * IDS_PER_LAYER);
        let mut next_id = || ids.next().unwrap_or(0);
        let trunk = TrunkNet::init(config, &mut next_id, device, rng);
        let features = config.features();
        let hidden = NormalizedDense::init(features, hidden_units, next_id(), device, rng);
        let output_id = next_id();
        Self {
            trunk,
            hidden,
            output_weight: uniform_parameter(
                output_id,
                [config.materials(), hidden_units],
                hidden_units,
                device,
                rng,
            ),
            output_bias: uniform_parameter(
                output_id + 1,
                [config.materials()],
                hidden_units,
                device,
                rng,
            ),
        }
    }

    /// Runs a training pass with batch statistics in all layers and `mask` in front of the dense layer.
    ///
    /// - `sweeps`: `[batch, 1, steps, taxels]`
    /// - `mask`: `[batch, features]`, from [`crate::dropout_masks`]
    pub fn forward_train(&self, sweeps: Tensor<4>, mask: Tensor<2>) -> TrainingForward {
        let mut statistics = Vec::with_capacity(self.trunk.normalized_layers() + 1);
        let features = self
            .trunk
            .forward_train(without_channel(sweeps), &mut statistics);
        let (hidden, batch) = self.hidden.forward_train(features * mask);
        statistics.push(batch);
        TrainingForward {
            logits: self.output(hidden.clone()),
            hidden,
            statistics,
        }
    }

    /// Moves the running statistics of every normalised layer towards those of a batch.
    ///
    /// # Panics
    /// If `statistics` does not have one entry for each normalised layer.
    pub fn update_running_stats(&mut self, statistics: &[BatchStatistics]) {
        let trunk = self.trunk.normalized_layers();
        assert_eq!(
            statistics.len(),
            trunk + 1,
            "one entry for each normalised layer"
        );
        self.trunk.update_running_stats(&statistics[..trunk]);
        self.hidden.update_running_stats(&statistics[trunk]);
    }

    /// Returns the number of layers with running statistics: those of the trunk in their order, then the dense layer.
    pub fn normalized_layers(&self) -> usize {
        self.trunk.normalized_layers() + 1
    }

    /// Returns the batch statistics of a layer with running statistics, for sweeps that pass the layers before it with fixed statistics.
    ///
    /// - `layer`: below [`Network::normalized_layers`]
    /// - `sweeps`: `[batch, 1, steps, taxels]`
    /// - `masks`: `[rows, features]` in front of the dense layer; a single sweep meets each of them
    pub fn statistics_of(
        &self,
        layer: usize,
        sweeps: Tensor<4>,
        masks: Tensor<2>,
    ) -> BatchStatistics {
        if layer < self.trunk.normalized_layers() {
            return self.trunk.statistics_of(layer, without_channel(sweeps));
        }
        let features = self.features(sweeps);
        self.hidden.forward_train(features * masks).1
    }

    /// Returns the running statistics of a layer.
    pub fn running_statistics(&self, layer: usize) -> BatchStatistics {
        let mut net = self.clone();
        let [mean, variance] = net.running_mut(layer);
        BatchStatistics {
            mean: mean.clone(),
            variance: variance.clone(),
        }
    }

    /// Replaces the running statistics of a layer.
    pub fn set_running_statistics(&mut self, layer: usize, statistics: BatchStatistics) {
        let [mean, variance] = self.running_mut(layer);
        (*mean, *variance) = (statistics.mean, statistics.variance);
    }

    fn running_mut(&mut self, layer: usize) -> [&mut Tensor<1>; 2] {
        if layer < self.trunk.normalized_layers() {
            return self.trunk.running_mut(layer);
        }
        let hidden = &mut self.hidden;
        [&mut hidden.running_mean, &mut hidden.running_variance]
    }

    /// Returns features with fixed statistics: `[batch, 1, steps, taxels] -> [batch, features]`.
    ///
    /// Dropout follows the features, so a Monte Carlo prediction computes them only once.
    pub fn features(&self, sweeps: Tensor<4>) -> Tensor<2> {
        self.trunk.forward(without_channel(sweeps))
    }

    /// Returns logits with fixed statistics: `[rows, features] -> [rows, materials]`.
    pub fn head(&self, features: Tensor<2>) -> Tensor<2> {
        self.output(self.hidden.forward(features))
    }

    /// Returns the inputs of the output layer with fixed statistics: `[rows, features] -> [rows, hidden]`.
    ///
    /// This is the feature space of transfer learning (thesis, section 4.6.1).
    pub fn embedding(&self, features: Tensor<2>) -> Tensor<2> {
        self.hidden.forward(features)
    }

    /// Returns the dense layer with its running statistics folded into weights and bias.
    pub fn folded_hidden(&self) -> DenseWeights {
        self.hidden.folded()
    }

    /// Returns the output layer.
    pub fn output_layer(&self) -> LinearHead {
        let [materials, hidden] = self.output_weight.val().dims();
        let weights = crate::values::values(self.output_weight.val());
        let biases = crate::values::values(self.output_bias.val());
        debug_assert_eq!(biases.len(), materials);
        LinearHead {
            weights: weights
                .chunks_exact(hidden)
                .map(|row| row.iter().map(|w| f64::from(*w)).collect())
                .collect(),
            biases: biases.iter().map(|b| f64::from(*b)).collect(),
        }
    }

    fn output(&self, hidden: Tensor<2>) -> Tensor<2> {
        hidden.matmul(self.output_weight.val().transpose()) + self.output_bias.val().unsqueeze()
    }
}

/// Drops the channel axis: `[batch, 1, steps, taxels] -> [batch, steps, taxels]`.
fn without_channel(sweeps: Tensor<4>) -> Tensor<3> {
    sweeps.squeeze_dim(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Architecture, Features, InputShape, Mlp};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn published_sizes_follow_from_the_defaults() {
        let input = InputShape {
            steps: 1000,
            taxels: 16,
        };
        let config = NetworkConfig::new(Architecture::default(), input, 36).unwrap();
        assert_eq!(config.convolutions().unwrap().1, [10, 10, 10]);
        assert_eq!(config.features(), 2048);
        let net = Network::init(&config, &Device::flex(), &mut ChaCha8Rng::seed_from_u64(1));
        let convolutions = 75 * 32 + 75 * 32 * 64 + 75 * 64 * 128;
        let norms = 2 * (32 + 64 + 128 + 512);
        assert_eq!(
            net.num_params(),
            convolutions + norms + 2048 * 512 + 512 * 36 + 36
        );
    }

    #[test]
    fn uneven_steps_keep_their_last_pooled_step() {
        let input = InputShape {
            steps: 43,
            taxels: 3,
        };
        let architecture = Architecture::tactnet2(&[2, 3], 4);
        let config = NetworkConfig::new(architecture, input, 5).unwrap();
        let net = Network::init(&config, &Device::flex(), &mut ChaCha8Rng::seed_from_u64(1));
        let sweeps = Tensor::ones([2, 1, 43, 3], &Device::flex());
        let features = net.features(sweeps);
        assert_eq!(features.dims(), [2, config.features()]);
        assert_eq!(net.head(features.clone()).dims(), [2, 5]);
        // The folded dense layer and the extracted output layer give the same results as the network.
        let folded = Mlp::from_layers(&[net.folded_hidden()], &Device::flex());
        let embedding = folded.forward(features.clone()).clamp_min(0.0);
        let apart = (embedding.clone() - net.embedding(features.clone()))
            .abs()
            .max();
        assert!(apart.into_scalar::<f32>() < 1e-5);
        let embedding = Features::new(4, crate::values::values(embedding));
        let head: Vec<f32> = crate::values::values(net.head(features));
        for (found, scores) in net
            .output_layer()
            .log_probabilities(&embedding)
            .iter()
            .zip(head.chunks(5))
        {
            for (found, expected) in found.iter().zip(crate::log_softmax(scores)) {
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
        }
    }
}
