//! The ways to tell whether two sweeps differ.

use tactnet_models::{Features, LinearHead, Mlp, WeightPrior, argmax};
use tactnet_pipeline::{Embedding, SweepPair, predict_difference};

use crate::context::Cancelled;

/// The distance between the sweeps of a pair.
#[derive(Clone, Copy)]
pub(super) enum Apart {
    /// Euclidean distance of the outputs, one number: the published network.
    Outputs,
    /// Difference of every output, `|a - b|`.
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

/// Something that was fitted to training pairs and gives the probability that two sweeps differ.
pub(super) enum PairScorer {
    /// The published network, or the same on all differences. Inputs are divided by `scale`.
    Network {
        apart: Apart,
        mlp: Box<Mlp>,
        scale: f32,
    },
    /// Logistic regression on one distance.
    Threshold(LinearHead),
    /// Whether the two have the same most probable material.
    MostProbable,
    /// Bayes' rule on the two posteriors, where half of all pairs are of one material.
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
                each.map(|pair| different(&log_p[pair.first], &log_p[pair.second]))
                    .collect()
            }
        }
    }
}

/// Returns the probability that two sweeps are of different materials, given the posterior of each: `s = sum_m a_m b_m` is the chance that
/// labels drawn from both agree, which they do with a chance of `1 / K` where nothing is known; of pairs half are of one material.
///
/// With uniform priors `p(x_a, x_b | same) ~ s / K` and `p(x_a, x_b | different) ~ (1 - s) / (K (K - 1))`, so that
///
/// ```text
/// P(different) = (1 - s) / ((1 - s) + (K - 1) s)
/// ```
pub(super) fn different(a: &[f64], b: &[f64]) -> f64 {
    let same: f64 = a.iter().zip(b).map(|(a, b)| (a + b).exp()).sum();
    let apart = (1.0 - same).max(0.0);
    apart / (apart + (a.len() as f64 - 1.0) * same)
}

pub(super) fn scaled(mut features: Features, scale: f32) -> Features {
    features.values_mut().iter_mut().for_each(|v| *v /= scale);
    features
}

/// Logistic regression of 'different' on the distance of embeddings.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn posteriors_that_say_nothing_leave_one_half() {
        for materials in [2, 6, 36] {
            let flat = vec![-(materials as f64).ln(); materials];
            assert!((different(&flat, &flat) - 0.5).abs() < 1e-12, "{materials}");
        }
    }

    /// The joint posterior of both labels, term by term, with half of the pairs of one material.
    #[test]
    fn the_rule_is_the_sum_over_all_pairs_of_labels() {
        let logs = |p: [f64; 3]| p.map(f64::ln);
        let (a, b) = ([0.7, 0.2, 0.1], [0.3, 0.3, 0.4]);
        let (mut same, mut apart) = (0.0, 0.0);
        for (i, a) in a.iter().enumerate() {
            for (j, b) in b.iter().enumerate() {
                if i == j {
                    same += 0.5 / 3.0 * a * b;
                } else {
                    apart += 0.5 / 6.0 * a * b;
                }
            }
        }
        let found = different(&logs(a), &logs(b));
        assert!((found - apart / (same + apart)).abs() < 1e-12, "{found}");
    }
}
