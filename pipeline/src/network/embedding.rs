//! What a network makes of sweeps before it names a material.

use tactnet_data::SweepView;
use tactnet_models::{Features, log_softmax};

/// Features of every sweep of a view, in the order of its positions.
#[derive(Debug, Clone)]
pub struct Embedding {
    /// Label of every sweep.
    pub labels: Vec<usize>,
    /// `[sweeps][features]`: what the convolutions give, in front of the dropout (2048 for TactMat).
    pub convolution: Features,
    /// `[sweeps][hidden]`: what the output layer sees (512).
    pub hidden: Features,
    /// `[sweeps][materials]`: the output layer's scores.
    pub logits: Features,
}

impl Embedding {
    /// Number of sweeps.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Returns true if there is no sweep.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The sweeps at `positions`, in that order.
    pub fn select(&self, positions: &[usize]) -> Self {
        Self {
            labels: positions.iter().map(|&p| self.labels[p]).collect(),
            convolution: self.convolution.select(positions),
            hidden: self.hidden.select(positions),
            logits: self.logits.select(positions),
        }
    }

    /// The sweeps of a view that lies within the one this was made from.
    ///
    /// # Panics
    /// If a sweep of `part` is not in `whole`.
    pub fn part(&self, whole: &SweepView<'_>, part: &SweepView<'_>) -> Self {
        let positions: Vec<usize> = part
            .indices()
            .iter()
            .map(|index| {
                whole
                    .indices()
                    .binary_search(index)
                    .unwrap_or_else(|_| panic!("sweep {index} has been embedded"))
            })
            .collect();
        self.select(&positions)
    }

    /// Log-probabilities of a plain prediction: `[sweeps][materials]`.
    pub fn log_probabilities(&self) -> Vec<Vec<f64>> {
        self.logits.rows().map(log_softmax).collect()
    }
}
