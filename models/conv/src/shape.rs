//! Sizes of one convolution block.

/// Sizes of one block: convolution with SAME zero padding, batch normalisation, ReLU, max-pool over time.
///
/// The input is `[batch, steps, taxels, maps_in]`, the output `[batch, pooled_steps, taxels, maps_out]`, the weights
/// `[maps_out, maps_in, kernel steps, kernel taxels]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BlockShape {
    /// Number of sweeps in the batch.
    pub batch: usize,
    /// Number of time steps of the input.
    pub steps: usize,
    /// Number of taxels of the input and the output.
    pub taxels: usize,
    /// Number of input maps.
    pub maps_in: usize,
    /// Number of output maps.
    pub maps_out: usize,
    /// Kernel size, time steps by taxels; both are odd.
    pub kernel: [usize; 2],
    /// Number of steps in one pooled step, 1 to 256.
    pub pool: usize,
}

impl BlockShape {
    /// Returns the number of steps after pooling; the last one covers the remaining steps.
    pub fn pooled_steps(&self) -> usize {
        self.steps.div_ceil(self.pool)
    }

    /// Returns the number of values in the input.
    pub fn input_len(&self) -> usize {
        self.batch * self.steps * self.taxels * self.maps_in
    }

    /// Returns the number of values in the pooled output.
    pub fn output_len(&self) -> usize {
        self.batch * self.pooled_steps() * self.taxels * self.maps_out
    }

    /// Returns the number of weights.
    pub fn weight_len(&self) -> usize {
        self.maps_out * self.maps_in * self.kernel[0] * self.kernel[1]
    }

    /// Returns the number of values per map in the batch statistics.
    pub fn count(&self) -> usize {
        self.batch * self.steps * self.taxels
    }

    /// Returns the zero steps and taxels that SAME padding adds on either side.
    pub fn padding(&self) -> [usize; 2] {
        [self.kernel[0] / 2, self.kernel[1] / 2]
    }

    pub(super) fn check(&self) {
        assert!(
            self.kernel.iter().all(|k| k % 2 == 1)
                && (1..=256).contains(&self.pool)
                && self.output_len() > 0,
            "a block needs odd kernel sizes, a pool of 1 to 256 steps and no empty dimension, found {self:?}"
        );
    }
}
