//! Feature extraction with TactNet-II's convolution blocks.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use rand::Rng;

use crate::block::{BatchStatistics, BlockConfig, ConvBlock};
use crate::config::ConvolutionShape;

/// Convolution blocks on sweeps `[batch, steps, taxels]`.
#[derive(Module, Debug)]
pub struct ConvTrunk {
    pub(crate) blocks: Vec<ConvBlock>,
    /// Number of pooled steps of the longest sweep.
    #[module(skip)]
    pub(crate) pooled_steps: usize,
}

impl ConvTrunk {
    /// Creates blocks with random weights; each block takes its first id from `next_id`.
    pub(crate) fn init(
        shape: &ConvolutionShape,
        mut next_id: impl FnMut() -> u64,
        device: &Device,
        rng: &mut impl Rng,
    ) -> Self {
        let mut maps_in = 1;
        let mut blocks = Vec::new();
        for (&maps_out, &pool) in shape.maps.iter().zip(&shape.pools) {
            let block = BlockConfig {
                maps_in,
                maps_out,
                kernel: shape.kernel,
                pool,
            };
            blocks.push(ConvBlock::init(block, next_id(), device, rng));
            maps_in = maps_out;
        }
        Self {
            blocks,
            pooled_steps: shape.pooled_steps(),
        }
    }

    /// Returns features `[batch, maps x pooled steps x taxels]` with batch statistics, which it appends to `statistics`. Pooled steps that a
    /// shorter sweep does not have are zero.
    pub(crate) fn forward_train(
        &self,
        sweeps: Tensor<3>,
        statistics: &mut Vec<BatchStatistics>,
    ) -> Tensor<2> {
        let mut maps = sweeps.unsqueeze_dim::<4>(3);
        for block in &self.blocks {
            let (pooled, batch) = block.forward_train(maps);
            maps = pooled;
            statistics.push(batch);
        }
        flat_features(self.filled(maps))
    }

    /// Returns features with fixed statistics.
    pub(crate) fn forward(&self, sweeps: Tensor<3>) -> Tensor<2> {
        let maps = sweeps.unsqueeze_dim::<4>(3);
        let blocks = self.blocks.iter();
        flat_features(self.filled(blocks.fold(maps, |maps, block| block.forward(maps))))
    }

    /// Returns `[batch, steps, taxels, maps]` with zeros for the pooled steps that are missing.
    fn filled(&self, maps: Tensor<4>) -> Tensor<4> {
        let [batch, steps, taxels, of_step] = maps.dims();
        if steps == self.pooled_steps {
            return maps;
        }
        let missing = [batch, self.pooled_steps - steps, taxels, of_step];
        let zeros = Tensor::zeros(missing, &maps.device());
        Tensor::cat(vec![maps, zeros], 1)
    }

    /// Returns the batch statistics of a block; those before it use their running statistics.
    pub(crate) fn statistics_of(&self, block: usize, sweeps: Tensor<3>) -> BatchStatistics {
        let maps = sweeps.unsqueeze_dim::<4>(3);
        let before = self.blocks[..block].iter();
        let maps = before.fold(maps, |maps, block| block.forward(maps));
        self.blocks[block].forward_train(maps).1
    }

    /// Returns the number of layers with running statistics.
    pub(crate) fn normalized_layers(&self) -> usize {
        self.blocks.len()
    }

    /// - `statistics`: one entry for each block
    pub(crate) fn update_running_stats(&mut self, statistics: &[BatchStatistics]) {
        for (block, batch) in self.blocks.iter_mut().zip(statistics) {
            block.update_running_stats(batch);
        }
    }
}

/// Flattens `[batch, steps, taxels, maps]` to `[batch, maps x steps x taxels]`, the order of the stored weights.
fn flat_features(maps: Tensor<4>) -> Tensor<2> {
    maps.permute([0, 3, 1, 2]).flatten(1, 3)
}
