//! Sizes of one convolution block.

/// Sizes of one block: convolution with SAME zero padding, batch normalisation, ReLU, max-pool over time.
///
/// Maps lie channels last: the input is `[batch, steps, taxels, maps_in]`, the output
/// `[batch, pooled_steps, taxels, maps_out]`. Weights are `[maps_out, maps_in, kernel steps, kernel taxels]`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BlockShape {
    /// Sweeps in the batch.
    pub batch: usize,
    /// Time steps of the input.
    pub steps: usize,
    /// Taxels of the input (and of the output).
    pub taxels: usize,
    /// Maps that come in.
    pub maps_in: usize,
    /// Maps that go out.
    pub maps_out: usize,
    /// Kernel: time steps by taxels, both odd.
    pub kernel: [usize; 2],
    /// Steps that one pooled step covers, at most 256.
    pub pool: usize,
}

impl BlockShape {
    /// Steps after pooling; the last one covers whatever steps are left.
    pub fn pooled_steps(&self) -> usize {
        self.steps.div_ceil(self.pool)
    }

    /// Values of the input.
    pub fn input_len(&self) -> usize {
        self.batch * self.steps * self.taxels * self.maps_in
    }

    /// Values of the pooled output.
    pub fn output_len(&self) -> usize {
        self.batch * self.pooled_steps() * self.taxels * self.maps_out
    }

    /// Values of the weights.
    pub fn weight_len(&self) -> usize {
        self.maps_out * self.maps_in * self.kernel[0] * self.kernel[1]
    }

    /// Values per map that batch statistics average over.
    pub fn count(&self) -> usize {
        self.batch * self.steps * self.taxels
    }

    /// Zero rows and columns that SAME padding adds on either side.
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
