//! Methods that decide whether two sweeps are of different materials.

use tactnet_models::{Features, LinearHead, Mlp, WeightPrior, argmax};
use tactnet_pipeline::{
    Embedding, SweepPair, predict_difference, probability_of_different_materials,
};

use crate::context::Cancelled;

/// A distance between the sweeps of a pair.
#[derive(Clone, Copy)]
pub(super) enum Apart {
    /// Euclidean distance of the outputs, one number, as in the published network.
    Outputs,
    /// Absolute difference of each output, `|a - b|`.
    EveryOutput,
    /// Euclidean distance of the embeddings.
    Embedding,
}

impl Apart {
    pub(super) fn of(self, embedding: &Embedding, pairs: &[SweepPair]) -> Features {
        let rows = match self {
            Self::Outputs | Self::EveryOutput => &embedding.logits,
            Self::Embedding => &embedding.hidden,
        };
        let differences = |pair: &SweepPair| -> Vec<f32> {
            let (a, b) = (rows.row(pair.first), rows.row(pair.second));
            a.iter().zip(b).map(|(a, b)| (a - b).abs()).collect()
        };
        match self {
            Self::EveryOutput => {
                Features::new(rows.width(), pairs.iter().flat_map(differences).collect())
            }
            Self::Outputs | Self::Embedding => {
                let norm = |d: Vec<f32>| d.iter().map(|d| d * d).sum::<f32>().sqrt();
                Features::new(
                    1,
                    pairs.iter().map(|pair| norm(differences(pair))).collect(),
                )
            }
        }
    }
}

/// A method that returns the probability that two sweeps are of different materials.
pub(super) enum PairScorer {
    /// The published network, or the same network on all differences. Inputs are divided by `scale`.
    Network {
        apart: Apart,
        mlp: Box<Mlp>,
        scale: f32,
    },
    /// Logistic regression on one distance.
    Threshold(LinearHead),
    /// Comparison of the most probable materials.
    MostProbable,
    /// Bayes' rule on the two posteriors, with half of all pairs of the same material.
    Bayes,
}

impl PairScorer {
    pub(super) fn probabilities(&self, embedding: &Embedding, pairs: &[SweepPair]) -> Vec<f64> {
        match self {
            Self::Network { apart, mlp, scale } => {
                predict_difference(mlp, &scaled(apart.of(embedding, pairs), *scale))
            }
            Self::Threshold(head) => head
                .log_probabilities(&Apart::Embedding.of(embedding, pairs))
                .iter()
                .map(|log_p| log_p[1].exp())
                .collect(),
            Self::MostProbable => {
                let log_p = embedding.log_probabilities();
                let labels: Vec<usize> = log_p.iter().map(|row| argmax(row)).collect();
                let differ = |pair: &SweepPair| labels[pair.first] != labels[pair.second];
                pairs.iter().map(|pair| f64::from(differ(pair))).collect()
            }
            Self::Bayes => {
                let log_p = embedding.log_probabilities();
                let each = pairs.iter();
                each.map(|pair| {
                    probability_of_different_materials(&log_p[pair.first], &log_p[pair.second])
                })
                .collect()
            }
        }
    }
}

pub(super) fn scaled(mut features: Features, scale: f32) -> Features {
    features.values_mut().iter_mut().for_each(|v| *v /= scale);
    features
}

/// Fits a logistic regression of 'different' on the distance of embeddings.
pub(super) fn threshold(train: &Embedding, pairs: &[SweepPair]) -> Result<PairScorer, Cancelled> {
    let distances = Apart::Embedding.of(train, pairs);
    let different: Vec<usize> = pairs
        .iter()
        .map(|pair| usize::from(pair.different))
        .collect();
    let prior = WeightPrior::weight_decay(1, 1e-6, pairs.len());
    Ok(PairScorer::Threshold(LinearHead::fit(
        &distances, &different, 2, &prior,
    )?))
}
