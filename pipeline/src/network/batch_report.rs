//! Report of a batch of a training.

/// Statistics of one batch.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchReport {
    /// Epoch, counted from 0.
    pub epoch: usize,
    /// Batch, counted from 0.
    pub batch: usize,
    /// Number of batches in an epoch.
    pub batches: usize,
    /// Number of epochs.
    pub epochs: usize,
    /// Mean loss of the epoch so far, in nats per sweep. On a GPU `None` until the epoch's last batch, since reading it would stall the GPU.
    pub mean_loss: Option<f64>,
    /// Accuracy on the epoch's training sweeps so far, with dropout; `None` as `mean_loss`.
    pub accuracy: Option<f64>,
    /// Accuracy on adversarial training sweeps; `None` as `mean_loss`, and without adversarial training.
    pub adversarial_accuracy: Option<f64>,
    /// Learning rate of the batch.
    pub learning_rate: f64,
}

impl BatchReport {
    /// Returns true if this batch was the last of its epoch.
    pub fn ends_epoch(&self) -> bool {
        self.batch + 1 == self.batches
    }
}
