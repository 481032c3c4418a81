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

/// Returns the mean of the cross entropies times the weights of the sweeps, in nats.
///
/// - `logits`: `[batch, materials]`
/// - `labels`: `[batch]`
/// - `weights`: `[batch]`; of mean 1 over the training set, not over the batch, so that a batch of small weights moves the network less
pub fn weighted_cross_entropy(
    logits: Tensor<2>,
    labels: Tensor<1, Int>,
    weights: Tensor<1>,
) -> Tensor<1> {
    let of_label = log_softmax(logits, 1).gather(1, labels.unsqueeze_dim(1));
    of_label.mul(weights.unsqueeze_dim(1)).mean().neg()
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;

    #[test]
    fn whole_weights_are_repetitions_of_the_sweep() {
        let device = Device::flex();
        let logits = |rows: &[[f32; 2]]| -> Tensor<2> {
            let data = TensorData::new(rows.as_flattened().to_vec(), [rows.len(), 2]);
            Tensor::from_data(data, &device)
        };
        let labels = |labels: &[i64]| -> Tensor<1, Int> {
            Tensor::from_data(TensorData::new(labels.to_vec(), [labels.len()]), &device)
        };
        let (a, b) = ([1.0, -0.5], [0.25, 2.0]);
        let repeated = cross_entropy(logits(&[a, b, b, b]), labels(&[0, 0, 0, 0]));
        // Weights 1 and 3 have a mean of 2 over the two sweeps.
        let weights = Tensor::from_data(TensorData::new(vec![0.5_f32, 1.5], [2]), &device);
        let weighted = weighted_cross_entropy(logits(&[a, b]), labels(&[0, 0]), weights);
        let (repeated, weighted): (f32, f32) = (repeated.into_scalar(), weighted.into_scalar());
        // Two roundings of single precision.
        assert!((repeated - weighted).abs() < 1e-6, "{repeated} {weighted}");
    }
}
