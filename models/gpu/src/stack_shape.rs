//! Sizes of networks that train together, and the ranges of their tensors.

use std::ops::Range;

use tactnet_conv::BlockShape;

/// Sizes of networks with one architecture: convolution blocks, dropout, a normalised dense layer, an output layer.
#[derive(Debug, Clone, PartialEq)]
pub struct StackShape {
    /// Number of networks.
    pub networks: usize,
    /// Maximum number of sweeps in a batch.
    pub batch: usize,
    /// Number of steps in a sweep.
    pub steps: usize,
    /// Number of taxels in a sweep.
    pub taxels: usize,
    /// Number of maps and pool size in steps of each block.
    pub blocks: Vec<[usize; 2]>,
    /// Kernel size, time steps by taxels; both are odd.
    pub kernel: [usize; 2],
    /// Number of units in the dense layer.
    pub hidden: usize,
    /// Number of units in the output layer.
    pub materials: usize,
}

/// Number of bits in a word of a dropout mask.
pub(crate) const WORD: usize = 32;

impl StackShape {
    /// Returns the blocks of one network.
    pub(crate) fn block_shapes(&self) -> Vec<BlockShape> {
        let (mut maps_in, mut steps) = (1, self.steps);
        let mut shapes = Vec::with_capacity(self.blocks.len());
        for &[maps_out, pool] in &self.blocks {
            let shape = BlockShape {
                batch: self.batch,
                steps,
                taxels: self.taxels,
                maps_in,
                maps_out,
                kernel: self.kernel,
                pool,
            };
            (maps_in, steps) = (maps_out, shape.pooled_steps());
            shapes.push(shape);
        }
        shapes
    }

    /// Returns the number of steps after the last block.
    pub(crate) fn pooled_steps(&self) -> usize {
        let blocks = self.blocks.iter();
        blocks.fold(self.steps, |steps, [_, pool]| steps.div_ceil(*pool))
    }

    /// Returns the number of maps of the last block.
    pub(crate) fn last_maps(&self) -> usize {
        self.blocks.last().map_or(1, |[maps, _]| *maps)
    }

    /// Returns the number of features of a sweep.
    pub fn features(&self) -> usize {
        self.last_maps() * self.pooled_steps() * self.taxels
    }

    /// Returns the number of values in a sweep.
    pub fn values(&self) -> usize {
        self.steps * self.taxels
    }

    /// Returns the number of words in a dropout mask of one sweep; feature `f` is bit `f % 32` of word `f / 32`.
    pub fn mask_words(&self) -> usize {
        self.features().div_ceil(WORD)
    }

    /// Returns the number of normalised layers: the blocks and the dense layer.
    pub fn layers(&self) -> usize {
        self.blocks.len() + 1
    }

    /// Returns the number of outputs of a normalised layer.
    pub fn width(&self, layer: usize) -> usize {
        self.blocks
            .get(layer)
            .map_or(self.hidden, |[maps, _]| *maps)
    }

    /// Returns the number of values per sweep and output of a normalised layer that its statistics cover.
    pub fn values_of_sweep(&self, layer: usize) -> usize {
        let before = self.blocks.iter().take(layer);
        let steps = before.fold(self.steps, |steps, [_, pool]| steps.div_ceil(*pool));
        if layer < self.blocks.len() {
            steps * self.taxels
        } else {
            1
        }
    }

    fn weight_len(&self, layer: usize) -> usize {
        match layer.cmp(&self.blocks.len()) {
            std::cmp::Ordering::Less => {
                let maps_in = layer.checked_sub(1).map_or(1, |before| self.width(before));
                self.width(layer) * maps_in * self.kernel[0] * self.kernel[1]
            }
            std::cmp::Ordering::Equal => self.hidden * self.features(),
            std::cmp::Ordering::Greater => self.materials * self.hidden,
        }
    }

    /// Returns the range of a layer's weights among a network's parameters; the output layer follows the normalised layers.
    pub fn weight(&self, layer: usize) -> Range<usize> {
        let begin = (0..layer).map(|before| self.weight_len(before)).sum();
        begin..begin + self.weight_len(layer)
    }

    /// Returns the number of weights, which come first among the parameters.
    pub fn weights(&self) -> usize {
        self.weight(self.layers()).end
    }

    /// Returns the range of a normalised layer's scale among the parameters.
    pub fn gamma(&self, layer: usize) -> Range<usize> {
        let before: usize = (0..layer).map(|before| 2 * self.width(before)).sum();
        let begin = self.weights() + before;
        begin..begin + self.width(layer)
    }

    /// Returns the range of a normalised layer's shift among the parameters.
    pub fn beta(&self, layer: usize) -> Range<usize> {
        let gamma = self.gamma(layer);
        gamma.end..gamma.end + self.width(layer)
    }

    /// Returns the range of the output layer's bias among the parameters.
    pub fn bias(&self) -> Range<usize> {
        let begin = self.beta(self.layers() - 1).end;
        begin..begin + self.materials
    }

    /// Returns the number of parameters of a network.
    pub fn parameters(&self) -> usize {
        self.bias().end
    }

    /// Returns the range of a normalised layer's mean among a network's statistics.
    pub fn mean(&self, layer: usize) -> Range<usize> {
        let begin = (0..layer).map(|before| 2 * self.width(before)).sum();
        begin..begin + self.width(layer)
    }

    /// Returns the range of a normalised layer's variance among the statistics.
    pub fn variance(&self, layer: usize) -> Range<usize> {
        let mean = self.mean(layer);
        mean.end..mean.end + self.width(layer)
    }

    /// Returns the number of statistics of a network.
    pub fn statistics(&self) -> usize {
        self.variance(self.layers() - 1).end
    }

    /// Returns the size in bytes of the largest buffer in a step, for all networks together.
    pub fn largest_buffer(&self) -> usize {
        let largest = self
            .block_shapes()
            .iter()
            .map(|shape| shape.count() * shape.maps_out)
            .max();
        let largest = largest.unwrap_or(0).max(self.parameters());
        self.networks * largest * size_of::<f32>()
    }

    /// Returns the approximate peak memory of a step in bytes, for all networks together.
    ///
    /// It covers the blocks' saved state and spectra, gradients of the largest block, and parameters with gradients and moments before
    /// and after the step.
    pub fn bytes(&self) -> usize {
        let blocks = self.block_shapes();
        let convolved = |shape: &BlockShape| shape.count() * shape.maps_out;
        let kept: usize = blocks.iter().map(|shape| 2 * convolved(shape)).sum();
        let largest = blocks
            .iter()
            .map(|shape| 2 * convolved(shape))
            .max()
            .unwrap_or(0);
        let numbers = kept + largest + 9 * self.parameters() + 4 * self.batch * self.values();
        self.networks * numbers * size_of::<f32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_lie_side_by_side_without_gap() {
        let shape = StackShape {
            networks: 3,
            batch: 36,
            steps: 1000,
            taxels: 16,
            blocks: vec![[32, 10], [64, 10], [128, 10]],
            kernel: [15, 5],
            hidden: 512,
            materials: 36,
        };
        let layers = shape.layers();
        let mut ranges: Vec<Range<usize>> = (0..=layers).map(|layer| shape.weight(layer)).collect();
        ranges.extend((0..layers).flat_map(|layer| [shape.gamma(layer), shape.beta(layer)]));
        ranges.push(shape.bias());
        let mut end = 0;
        for range in ranges {
            assert_eq!(range.start, end);
            end = range.end;
        }
        // Sizes of the published network.
        let convolutions = 75 * 32 + 75 * 32 * 64 + 75 * 64 * 128;
        let norms = 2 * (32 + 64 + 128 + 512);
        assert_eq!(end, convolutions + norms + 2048 * 512 + 512 * 36 + 36);
        assert_eq!(shape.parameters(), end);
        assert_eq!(shape.statistics(), norms);
        assert_eq!(shape.features(), 2048);
        let of_sweep: Vec<usize> = (0..layers)
            .map(|layer| shape.values_of_sweep(layer))
            .collect();
        assert_eq!(of_sweep, [16_000, 1600, 160, 1]);
    }
}
