//! Belief over materials: softmax in the log domain, fusion over sweeps, majority vote.

use serde::{Deserialize, Serialize};

/// `log softmax(scores)` in `f64`, stable for any finite scores.
pub fn log_softmax(scores: &[f32]) -> Vec<f64> {
    let largest = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let largest = f64::from(largest);
    let total: f64 = scores.iter().map(|s| (f64::from(*s) - largest).exp()).sum();
    scores
        .iter()
        .map(|s| f64::from(*s) - largest - total.ln())
        .collect()
}

/// Probabilities of the materials given all sweeps fused so far, under a flat prior.
///
/// Sweeps are taken as independent given the material, so their log-probabilities add (Bayesian fusion, thesis
/// section 4.3.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// `[materials]`, natural log, unnormalised.
    log_likelihood: Vec<f64>,
    sweeps: usize,
}

impl Belief {
    /// Knows nothing: the same probability for each of `materials`.
    ///
    /// # Panics
    /// If `materials` is zero.
    pub fn flat(materials: usize) -> Self {
        assert!(materials > 0, "a belief needs at least one material");
        Self {
            log_likelihood: vec![0.0; materials],
            sweeps: 0,
        }
    }

    /// Takes in one more sweep.
    ///
    /// - `log_probability`: `[materials]`, natural log of the probabilities given this sweep alone
    ///
    /// # Panics
    /// If the number of materials differs.
    pub fn fuse(&mut self, log_probability: &[f64]) {
        assert_eq!(
            log_probability.len(),
            self.log_likelihood.len(),
            "number of materials"
        );
        for (sum, log_p) in self.log_likelihood.iter_mut().zip(log_probability) {
            *sum += log_p.max(LOWEST_LOG_PROBABILITY);
        }
        self.sweeps += 1;
    }

    /// Number of sweeps fused.
    pub fn sweeps(&self) -> usize {
        self.sweeps
    }

    /// `[materials]`, sums to one.
    pub fn probabilities(&self) -> Vec<f64> {
        let largest = self
            .log_likelihood
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = self
            .log_likelihood
            .iter()
            .map(|l| (l - largest).exp())
            .collect();
        let total: f64 = weights.iter().sum();
        weights.iter().map(|w| w / total).collect()
    }

    /// The most probable label; the lowest among equals.
    pub fn label(&self) -> usize {
        first_largest(&self.log_likelihood)
    }
}

/// A probability of zero (a Monte Carlo average that underflowed) must not veto a material for ever.
const LOWEST_LOG_PROBABILITY: f64 = -100.0;

/// Index of the largest value, the first among equals.
pub fn first_largest(values: &[f64]) -> usize {
    let mut best = 0;
    for (index, value) in values.iter().enumerate() {
        if *value > values[best] {
            best = index;
        }
    }
    best
}

/// The label named most often; among equals the one whose summed log-probability is largest.
///
/// - `sweeps`: per sweep `[materials]` log-probabilities; each sweep votes for its most probable label
///
/// # Panics
/// If there is no sweep.
pub fn majority_vote(sweeps: &[&[f64]]) -> usize {
    assert!(!sweeps.is_empty(), "a vote needs at least one sweep");
    let materials = sweeps[0].len();
    let mut votes = vec![0_usize; materials];
    let mut belief = Belief::flat(materials);
    for sweep in sweeps {
        votes[first_largest(sweep)] += 1;
        belief.fuse(sweep);
    }
    let most = votes.iter().copied().max().unwrap_or(0);
    let contested: Vec<f64> = (0..materials)
        .map(|k| {
            if votes[k] == most {
                belief.log_likelihood[k]
            } else {
                f64::NEG_INFINITY
            }
        })
        .collect();
    first_largest(&contested)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn two_weak_sweeps_outweigh_one_strong_one() {
        let ln = |p: [f64; 2]| p.map(f64::ln);
        let mut belief = Belief::flat(2);
        belief.fuse(&ln([0.8, 0.2]));
        assert_eq!(belief.label(), 0);
        belief.fuse(&ln([0.3, 0.7]));
        belief.fuse(&ln([0.3, 0.7]));
        assert_eq!(belief.label(), 1);
        let expected = 0.8 * 0.3 * 0.3 / (0.8 * 0.3 * 0.3 + 0.2 * 0.7 * 0.7);
        assert!((belief.probabilities()[0] - expected).abs() < 1e-12);
        let votes = [ln([0.9999, 0.0001]), ln([0.4, 0.6]), ln([0.4, 0.6])];
        let votes: Vec<&[f64]> = votes.iter().map(|v| v.as_slice()).collect();
        assert_eq!(
            majority_vote(&votes),
            1,
            "a vote ignores how sure a sweep was"
        );
    }

    #[test]
    fn a_tied_vote_goes_to_the_larger_evidence() {
        let ln = |p: [f64; 3]| p.map(f64::ln);
        let votes = [
            ln([0.5, 0.4, 0.1]),
            ln([0.05, 0.9, 0.05]),
            ln([0.1, 0.1, 0.8]),
        ];
        let votes: Vec<&[f64]> = votes.iter().map(|v| v.as_slice()).collect();
        assert_eq!(majority_vote(&votes), 1);
    }

    #[test]
    fn a_probability_of_zero_is_no_veto_for_ever() {
        let mut belief = Belief::flat(2);
        belief.fuse(&[f64::NEG_INFINITY, 0.0]);
        for _ in 0..3 {
            belief.fuse(&[0.0, f64::NEG_INFINITY]);
        }
        assert_eq!(belief.label(), 0);
    }

    proptest! {
        #[test]
        fn a_belief_sums_to_one_and_ignores_label_and_sweep_order(
            scores in proptest::collection::vec(proptest::collection::vec(-40.0_f32..40.0, 5), 1..6),
            turn in 0_usize..5,
        ) {
            let mut belief = Belief::flat(5);
            let mut turned = Belief::flat(5);
            for sweep in &scores {
                belief.fuse(&log_softmax(sweep));
            }
            for sweep in scores.iter().rev() {
                let mut log_p = log_softmax(sweep);
                log_p.rotate_left(turn);
                turned.fuse(&log_p);
            }
            let mut expected = belief.probabilities();
            prop_assert!((expected.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            expected.rotate_left(turn);
            for (a, b) in expected.iter().zip(turned.probabilities()) {
                prop_assert!((a - b).abs() < 1e-9);
            }
        }
    }
}
