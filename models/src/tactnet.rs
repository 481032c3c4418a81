//! TactNet-II: three convolution blocks, dropout, a normalised dense layer, an output layer.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};

use crate::block::{BatchStatistics, BlockConfig, ConvBlock};
use crate::dense::NormalizedDense;
use crate::initial::uniform_parameter;
use crate::{DenseWeights, LinearHead, ModelError};

/// Parameters of a network, and outputs of one of its layers for one sweep, at most: 8 GiB of 32-bit floats.
pub const MAX_NUMBERS: u64 = 1 << 31;
/// Ids of parameters are spaced so that every layer keeps its own, whatever the others hold.
const IDS_PER_LAYER: u64 = 8;

/// The layers, as a recipe states them.
///
/// Source of the defaults: Tulbure & Bäuml, Humanoids 2018, figure 4 and table II.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Architecture {
    /// Maps of each convolution block.
    pub maps: Vec<usize>,
    /// Kernel: time steps by taxels, both odd.
    pub kernel: [usize; 2],
    /// Pool of each block in steps; by [`default_pools`] when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pools: Option<Vec<usize>>,
    /// Units of the fully connected layer.
    pub hidden: usize,
    /// Probability to keep a feature in the dropout in front of the fully connected layer, in `(0, 1]`.
    pub keep_probability: f64,
}

impl Default for Architecture {
    fn default() -> Self {
        Self {
            maps: vec![32, 64, 128],
            kernel: [15, 5],
            pools: None,
            hidden: 512,
            keep_probability: 0.8,
        }
    }
}

/// Shape of one sweep: `steps` by flattened `taxels`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputShape {
    /// Time steps.
    pub steps: usize,
    /// Taxels, rows and columns flattened.
    pub taxels: usize,
}

/// Pools for `blocks` blocks over `steps` steps: each takes ten steps, or all that are left where there are fewer.
///
/// 1000 steps give 10, 10, 10 as published; 400 steps give 10, 10, 4; 8800 steps give 10, 10, 10 and leave nine pooled
/// steps to the fully connected layer.
pub fn default_pools(steps: usize, blocks: usize) -> Vec<usize> {
    let mut left = steps;
    (0..blocks)
        .map(|_| {
            let pool = left.min(10);
            left = left.div_ceil(pool);
            pool
        })
        .collect()
}

/// A checked description of one network.
#[derive(Debug, Clone, PartialEq)]
pub struct TactNetConfig {
    architecture: Architecture,
    input: InputShape,
    materials: usize,
    pools: Vec<usize>,
}

impl TactNetConfig {
    /// Checks `architecture` for sweeps of shape `input` and `materials` output units.
    ///
    /// # Errors
    /// Names the setting that is out of range.
    pub fn new(
        architecture: Architecture,
        input: InputShape,
        materials: usize,
    ) -> Result<Self, ModelError> {
        let require = |holds: bool, setting, expected: &str, found: String| {
            if holds {
                Ok(())
            } else {
                Err(ModelError::Setting {
                    setting,
                    expected: expected.into(),
                    found,
                })
            }
        };
        let Architecture {
            maps,
            kernel,
            pools,
            hidden,
            keep_probability,
        } = &architecture;
        require(
            !maps.is_empty() && maps.iter().all(|m| *m > 0),
            "maps",
            "at least one block of at least one map",
            format!("{maps:?}"),
        )?;
        require(
            kernel.iter().all(|k| k % 2 == 1),
            "kernel",
            "two odd extents",
            format!("{kernel:?}"),
        )?;
        require(
            *hidden > 0,
            "hidden",
            "at least one unit",
            hidden.to_string(),
        )?;
        require(
            *keep_probability > 0.0 && *keep_probability <= 1.0,
            "keep_probability",
            "a probability above 0 and at most 1",
            keep_probability.to_string(),
        )?;
        require(
            input.steps > 0 && input.taxels > 0,
            "input",
            "at least one step of one taxel",
            format!("{} x {}", input.steps, input.taxels),
        )?;
        require(
            materials > 1,
            "materials",
            "at least two materials",
            materials.to_string(),
        )?;
        let pools = pools
            .clone()
            .unwrap_or_else(|| default_pools(input.steps, maps.len()));
        require(
            pools.len() == maps.len() && pools.iter().all(|p| *p > 0),
            "pools",
            "one positive pool for each block",
            format!("{pools:?} for {} blocks", maps.len()),
        )?;
        let config = Self {
            architecture,
            input,
            materials,
            pools,
        };
        for (setting, numbers) in [
            ("maps, hidden", config.parameters()),
            ("maps, steps, taxels", config.widest_layer()),
        ] {
            require(
                numbers.is_some_and(|numbers| numbers <= MAX_NUMBERS),
                setting,
                &format!("parameters, and outputs of each layer, of at most {MAX_NUMBERS} numbers"),
                numbers.map_or("more than a machine addresses".into(), |n| n.to_string()),
            )?;
        }
        Ok(config)
    }

    /// Returns the number of parameters; `None` where it is beyond all bounds.
    pub fn parameters(&self) -> Option<u64> {
        let Architecture {
            maps,
            kernel,
            hidden,
            ..
        } = &self.architecture;
        let product = |factors: &[usize]| {
            factors
                .iter()
                .try_fold(1u64, |all, factor| all.checked_mul(*factor as u64))
        };
        let mut all = 0u64;
        let mut maps_in = 1;
        for &maps_out in maps {
            // Weights; scale and shift of the normalisation.
            let weights = product(&[maps_in, maps_out, kernel[0], kernel[1]])?;
            all = all.checked_add(weights)?;
            all = all.checked_add(product(&[2, maps_out])?)?;
            maps_in = maps_out;
        }
        let features = product(&[self.pooled_steps(), self.input.taxels, maps_in])?;
        let dense = features.checked_mul(*hidden as u64)?;
        let output = product(&[hidden.checked_add(1)?, self.materials])?;
        all.checked_add(dense)?
            .checked_add(product(&[2, *hidden])?)?
            .checked_add(output)
    }

    /// Numbers that the widest block makes of one sweep; `None` where they are beyond all bounds.
    fn widest_layer(&self) -> Option<u64> {
        let maps = self.architecture.maps.iter().copied().max()?;
        (self.input.steps as u64)
            .checked_mul(self.input.taxels as u64)?
            .checked_mul(maps as u64)
    }

    fn pooled_steps(&self) -> usize {
        self.pools
            .iter()
            .fold(self.input.steps, |steps, pool| steps.div_ceil(*pool))
    }

    /// The layers.
    pub fn architecture(&self) -> &Architecture {
        &self.architecture
    }

    /// Shape of one sweep.
    pub fn input(&self) -> InputShape {
        self.input
    }

    /// Output units.
    pub fn materials(&self) -> usize {
        self.materials
    }

    /// Pool of each block, in steps.
    pub fn pools(&self) -> &[usize] {
        &self.pools
    }

    /// Features that reach the dropout: pooled steps times taxels times maps (16 x 128 = 2048 for TactMat).
    pub fn features(&self) -> usize {
        let maps = self.architecture.maps.last().copied().unwrap_or(1);
        self.pooled_steps() * self.input.taxels * maps
    }
}

/// Result of a training pass.
pub struct TrainingForward {
    /// `[batch, materials]`
    pub logits: Tensor<2>,
    /// `[batch, hidden]`: what the output layer sees.
    pub hidden: Tensor<2>,
    /// Statistics of every normalised layer, for [`TactNet::update_running_stats`].
    pub statistics: Vec<BatchStatistics>,
}

/// The network. Sweeps are `[batch, 1, steps, taxels]`.
#[derive(Module, Debug)]
pub struct TactNet {
    pub(crate) blocks: Vec<ConvBlock>,
    pub(crate) hidden: NormalizedDense,
    /// `[materials, hidden]`
    pub(crate) output_weight: Param<Tensor<2>>,
    /// `[materials]`
    pub(crate) output_bias: Param<Tensor<1>>,
}

impl TactNet {
    /// Fresh weights from `rng`. On a device with autodiff the parameters can be trained.
    pub fn init(config: &TactNetConfig, device: &Device, rng: &mut impl Rng) -> Self {
        let architecture = &config.architecture;
        let mut ids = (0..).map(|layer| 1 + layer * IDS_PER_LAYER);
        let mut next_id = || ids.next().unwrap_or(0);
        let mut maps_in = 1;
        let mut blocks = Vec::new();
        for (&maps_out, &pool) in architecture.maps.iter().zip(&config.pools) {
            let block = BlockConfig {
                maps_in,
                maps_out,
                kernel: architecture.kernel,
                pool,
            };
            blocks.push(ConvBlock::init(block, next_id(), device, rng));
            maps_in = maps_out;
        }
        let hidden = NormalizedDense::init(
            config.features(),
            architecture.hidden,
            next_id(),
            device,
            rng,
        );
        let output_id = next_id();
        Self {
            blocks,
            hidden,
            output_weight: uniform_parameter(
                output_id,
                [config.materials, architecture.hidden],
                architecture.hidden,
                device,
                rng,
            ),
            output_bias: uniform_parameter(
                output_id + 1,
                [config.materials],
                architecture.hidden,
                device,
                rng,
            ),
        }
    }

    /// Training pass: batch statistics everywhere, `mask` in front of the dense layer.
    ///
    /// - `sweeps`: `[batch, 1, steps, taxels]`
    /// - `mask`: `[batch, features]`, see [`crate::dropout_masks`]
    pub fn forward_train(&self, sweeps: Tensor<4>, mask: Tensor<2>) -> TrainingForward {
        let mut statistics = Vec::with_capacity(self.blocks.len() + 1);
        let mut maps = channels_last(sweeps);
        for block in &self.blocks {
            let (pooled, batch) = block.forward_train(maps);
            maps = pooled;
            statistics.push(batch);
        }
        let (hidden, batch) = self.hidden.forward_train(flat_features(maps) * mask);
        statistics.push(batch);
        TrainingForward {
            logits: self.output(hidden.clone()),
            hidden,
            statistics,
        }
    }

    /// Moves the running statistics of every normalised layer towards one batch's.
    ///
    /// # Panics
    /// If `statistics` does not hold one entry for each block and one for the dense layer.
    pub fn update_running_stats(&mut self, statistics: &[BatchStatistics]) {
        assert_eq!(
            statistics.len(),
            self.blocks.len() + 1,
            "one entry for each normalised layer"
        );
        for (block, batch) in self.blocks.iter_mut().zip(statistics) {
            block.update_running_stats(batch);
        }
        self.hidden
            .update_running_stats(&statistics[self.blocks.len()]);
    }

    /// Features with frozen statistics: `[batch, 1, steps, taxels] -> [batch, features]`.
    ///
    /// The only dropout comes behind them, so a Monte Carlo prediction needs them once.
    pub fn features(&self, sweeps: Tensor<4>) -> Tensor<2> {
        let maps = self
            .blocks
            .iter()
            .fold(channels_last(sweeps), |maps, block| block.forward(maps));
        flat_features(maps)
    }

    /// Dense and output layer with frozen statistics: `[rows, features] -> [rows, materials]` logits.
    pub fn head(&self, features: Tensor<2>) -> Tensor<2> {
        self.output(self.hidden.forward(features))
    }

    /// Returns the inputs of the output layer, with frozen statistics: `[rows, features] -> [rows, hidden]`. The feature space of transfer
    /// (thesis, section 4.6.1).
    pub fn embedding(&self, features: Tensor<2>) -> Tensor<2> {
        self.hidden.forward(features)
    }

    /// The dense layer with its frozen statistics folded into weights and bias.
    pub fn folded_hidden(&self) -> DenseWeights {
        self.hidden.folded()
    }

    /// The output layer.
    pub fn output_layer(&self) -> LinearHead {
        let [materials, hidden] = self.output_weight.val().dims();
        let weights = crate::weights::values(self.output_weight.val());
        let biases = crate::weights::values(self.output_bias.val());
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

/// `[batch, 1, steps, taxels] -> [batch, steps, taxels, 1]`
fn channels_last(sweeps: Tensor<4>) -> Tensor<4> {
    let [batch, one, steps, taxels] = sweeps.dims();
    sweeps.reshape([batch, steps, taxels, one])
}

/// `[batch, steps, taxels, maps] -> [batch, maps x steps x taxels]`, the order in which weights are stored.
fn flat_features(maps: Tensor<4>) -> Tensor<2> {
    maps.permute([0, 3, 1, 2]).flatten(1, 3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Features, Mlp};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn published_sizes_follow_from_the_defaults() {
        let input = InputShape {
            steps: 1000,
            taxels: 16,
        };
        let config = TactNetConfig::new(Architecture::default(), input, 36).unwrap();
        assert_eq!(config.pools(), [10, 10, 10]);
        assert_eq!(config.features(), 2048);
        let net = TactNet::init(&config, &Device::flex(), &mut ChaCha8Rng::seed_from_u64(1));
        let convolutions = 75 * 32 + 75 * 32 * 64 + 75 * 64 * 128;
        let norms = 2 * (32 + 64 + 128 + 512);
        assert_eq!(
            net.num_params(),
            convolutions + norms + 2048 * 512 + 512 * 36 + 36
        );
    }

    #[test]
    fn pools_follow_the_documented_rule() {
        assert_eq!(default_pools(1000, 3), [10, 10, 10]);
        assert_eq!(default_pools(400, 3), [10, 10, 4]);
        assert_eq!(default_pools(8800, 3), [10, 10, 10]);
        assert_eq!(default_pools(100, 3), [10, 10, 1]);
        assert_eq!(default_pools(7, 3), [7, 1, 1]);
    }

    #[test]
    fn uneven_steps_keep_their_last_pooled_step() {
        let input = InputShape {
            steps: 43,
            taxels: 3,
        };
        let architecture = Architecture {
            maps: vec![2, 3],
            hidden: 4,
            ..Architecture::default()
        };
        let config = TactNetConfig::new(architecture, input, 5).unwrap();
        let net = TactNet::init(&config, &Device::flex(), &mut ChaCha8Rng::seed_from_u64(1));
        let sweeps = Tensor::ones([2, 1, 43, 3], &Device::flex());
        let features = net.features(sweeps);
        assert_eq!(features.dims(), [2, config.features()]);
        assert_eq!(net.head(features.clone()).dims(), [2, 5]);
        // The dense layer folded, and the output layer taken out, are the same network.
        let folded = Mlp::from_layers(&[net.folded_hidden()], &Device::flex());
        let embedding = folded.forward(features.clone()).clamp_min(0.0);
        let apart = (embedding.clone() - net.embedding(features.clone()))
            .abs()
            .max();
        assert!(apart.into_scalar::<f32>() < 1e-5);
        let embedding = Features::new(4, crate::weights::values(embedding));
        let head: Vec<f32> = crate::weights::values(net.head(features));
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

    #[test]
    fn settings_out_of_range_are_named() {
        let input = InputShape {
            steps: 100,
            taxels: 4,
        };
        let message = |change: fn(&mut Architecture)| {
            let mut architecture = Architecture::default();
            change(&mut architecture);
            TactNetConfig::new(architecture, input, 3)
                .unwrap_err()
                .to_string()
        };
        assert!(message(|a| a.keep_probability = 0.0).contains("keep_probability"));
        assert!(message(|a| a.kernel = [14, 5]).contains("kernel"));
        assert!(message(|a| a.pools = Some(vec![10])).contains("one positive pool for each block"));
        assert!(message(|a| a.maps.clear()).contains("maps"));
    }
}
