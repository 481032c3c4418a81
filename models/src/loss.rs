//! Classification loss.

use burn::tensor::activation::log_softmax;
use burn::tensor::{Int, Tensor};

/// Returns the mean cross entropy in nats.
///
/// - `logits`: `[batch, materials]`
/// - `labels`: `[batch]`
pub fn cross_entropy(logits: Tensor<2>, labels: Tensor<1, Int>) -> Tensor<1> {
    log_softmax(logits, 1)
        .gather(1, labels.unsqueeze_dim(1))
        .mean()
        .neg()
}

/// Returns the mean cross entropy in nats between probabilities and a network's prediction.
///
/// - `logits`: `[batch, materials]`
/// - `probabilities`: `[batch, materials]`
pub fn soft_cross_entropy(logits: Tensor<2>, probabilities: Tensor<2>) -> Tensor<1> {
    let of_sweeps = (log_softmax(logits, 1) * probabilities).sum_dim(1);
    of_sweeps.mean().neg()
}
