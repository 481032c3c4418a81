//! Belief over materials: log softmax, Bayesian fusion of sweeps, majority vote.

use serde::{Deserialize, Serialize};

/// Returns `log softmax(scores)` in `f64`; stable for any finite scores.
pub fn log_softmax(scores: &[f32]) -> Vec<f64> {
    let mut out = vec![0.0; scores.len()];
    log_softmax_into(scores, &mut out);
    out
}

/// Writes [`log_softmax`] to `out` without allocating.
///
/// # Panics
/// If `scores` and `out` differ in length.
pub fn log_softmax_into(scores: &[f32], out: &mut [f64]) {
    assert_eq!(scores.len(), out.len(), "number of materials");
    let largest = scores.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let largest = f64::from(largest);
    let total: f64 = scores.iter().map(|s| (f64::from(*s) - largest).exp()).sum();
    let log_total = total.ln();
    for (out, score) in out.iter_mut().zip(scores) {
        *out = f64::from(*score) - largest - log_total;
    }
}

/// Writes the normalised `ln(mean over samples of exp(sample))` of each material to `out`; stable for any probability.
///
/// - `samples`: `[samples][materials]` log-probabilities
/// - `out`: `[materials]`
///
/// # Panics
/// If `samples` does not consist of whole rows.
pub fn log_mean_exp_into(samples: &[f64], out: &mut [f64]) {
    let materials = out.len();
    assert!(
        !samples.is_empty() && samples.len().is_multiple_of(materials),
        "whole samples of {materials} materials"
    );
    let number = (samples.len() / materials) as f64;
    for (material, mean) in out.iter_mut().enumerate() {
        let column = samples.iter().skip(material).step_by(materials);
        let largest = column.clone().copied().fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = column.map(|log_p| (log_p - largest).exp()).sum();
        *mean = largest + (sum / number).ln();
    }
    let total: f64 = out.iter().map(|log_p| log_p.exp()).sum();
    let log_total = total.ln();
    out.iter_mut().for_each(|mean| *mean -= log_total);
}

/// Returns the entropy of a distribution in nats.
///
/// - `log_p`: log-probabilities
pub fn entropy(log_p: &[f64]) -> f64 {
    -log_p
        .iter()
        .filter(|l| **l > f64::NEG_INFINITY)
        .map(|l| l.exp() * l)
        .sum::<f64>()
}

/// Returns the mutual information between label and weights in nats, a measure of disagreement between samples.
///
/// It is the entropy of the mean minus the mean of the entropies (Houlsby et al., 2011; Gal & Ghahramani, 2016).
///
/// - `samples`: `[samples][materials]` log-probabilities
/// - `mean`: `[materials]`, from [`log_mean_exp_into`]
pub fn mutual_information(samples: &[f64], mean: &[f64]) -> f64 {
    let rows = samples.chunks_exact(mean.len());
    let number = rows.len() as f64;
    entropy(mean) - rows.map(entropy).sum::<f64>() / number
}

/// Probabilities of the materials given all fused sweeps, under a flat prior.
///
/// Sweeps count as independent given the material, so their log-probabilities add up (thesis, section 4.3.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Belief {
    /// `[materials]`: sum of natural log-probabilities, not normalised.
    log_likelihood: Vec<f64>,
    sweeps: usize,
}

impl Belief {
    /// Returns the uniform belief over `materials`.
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

    /// Fuses the scores of one more sweep.
    ///
    /// - `log_probability`: `[materials]`, natural log-probabilities given this sweep alone
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

    /// Returns the number of fused sweeps.
    pub fn sweeps(&self) -> usize {
        self.sweeps
    }

    /// Returns the probabilities `[materials]`, which sum to one.
    pub fn probabilities(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.log_likelihood.len()];
        self.probabilities_into(&mut out);
        out
    }

    /// Writes [`Belief::probabilities`] to `out` without allocating.
    ///
    /// # Panics
    /// If the number of materials differs.
    pub fn probabilities_into(&self, out: &mut [f64]) {
        assert_eq!(out.len(), self.log_likelihood.len(), "number of materials");
        let largest = self
            .log_likelihood
            .iter()
            .copied()
            .fold(f64::NEG_INFINITY, f64::max);
        for (out, l) in out.iter_mut().zip(&self.log_likelihood) {
            *out = (l - largest).exp();
        }
        let total: f64 = out.iter().sum();
        out.iter_mut().for_each(|p| *p /= total);
    }

    /// Discards all sweeps.
    pub fn reset(&mut self) {
        self.log_likelihood.fill(0.0);
        self.sweeps = 0;
    }

    /// Returns the most probable label; the lowest one on a tie.
    pub fn label(&self) -> usize {
        argmax(&self.log_likelihood)
    }
}

/// Lower bound of a fused log-probability, so that one underflowed Monte Carlo average cannot rule out a material.
const LOWEST_LOG_PROBABILITY: f64 = -100.0;

/// Returns the index of the largest value; the first one on a tie.
pub fn argmax(values: &[f64]) -> usize {
    let mut best = 0;
    for (index, value) in values.iter().enumerate() {
        if *value > values[best] {
            best = index;
        }
    }
    best
}

/// Returns the label with most votes; on a tie, the one with the largest summed log-probability.
///
/// - `sweeps`: `[materials]` log-probabilities of each sweep, which votes for its most probable label
///
/// # Panics
/// If `sweeps` is empty.
pub fn majority_vote(sweeps: &[&[f64]]) -> usize {
    assert!(!sweeps.is_empty(), "a vote needs at least one sweep");
    let materials = sweeps[0].len();
    let mut votes = vec![0_usize; materials];
    let mut belief = Belief::flat(materials);
    for sweep in sweeps {
        votes[argmax(sweep)] += 1;
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
    argmax(&contested)
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

    #[test]
    fn runs_that_agree_tell_nothing_about_the_weights() {
        let sure = log_softmax(&[0.0, 3.0]);
        let unlike = log_softmax(&[3.0, 0.0]);
        let information = |samples: &[f64]| {
            let mut mean = [0.0; 2];
            log_mean_exp_into(samples, &mut mean);
            mutual_information(samples, &mean)
        };
        assert!(information(&[sure.clone(), sure.clone()].concat()).abs() < 1e-12);
        let apart = information(&[sure.clone(), unlike].concat());
        assert!((apart - (2.0_f64.ln() - entropy(&sure))).abs() < 1e-12);
        assert!((entropy(&[0.0, f64::NEG_INFINITY])).abs() < 1e-12);
    }

    #[test]
    fn the_mean_over_runs_survives_probabilities_below_f32() {
        let mean = |samples: &[Vec<f64>]| {
            let mut mean = [0.0; 2];
            log_mean_exp_into(&samples.concat(), &mut mean);
            mean
        };
        let found = mean(&[log_softmax(&[0.0, -300.0]), log_softmax(&[0.0, -310.0])]);
        let expected = -300.0 + ((1.0 + (-10.0_f64).exp()) / 2.0).ln();
        assert!((found[1] - expected).abs() < 1e-9, "{found:?}");
        let even = mean(&[
            vec![0.2_f64.ln(), 0.8_f64.ln()],
            vec![0.6_f64.ln(), 0.4_f64.ln()],
        ]);
        assert!((even[0].exp() - 0.4).abs() < 1e-12 && (even[1].exp() - 0.6).abs() < 1e-12);
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
