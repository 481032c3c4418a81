//! Metrics of predictions: accuracy with an interval, likelihood, calibration.

use serde::{Deserialize, Serialize};
use tactnet_data::{Seed, shuffle};
use tactnet_models::{Belief, majority_vote};

use crate::{Predictions, SweepScore};

/// Share with its 95 % interval.
///
/// The interval covers the sampling error of independent test sweeps for this one trained network. It covers no variance over training sets,
/// seeds or recording blocks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The share, 0 to 1.
    pub mean: f64,
    /// Lower end of the Wilson interval.
    pub ci95_low: f64,
    /// Upper end of the Wilson interval.
    pub ci95_high: f64,
    /// Number of independent trials.
    pub n: usize,
}

impl Estimate {
    /// Returns the Wilson score interval of a share `mean` observed in `n` independent trials (Wilson, 1927).
    ///
    /// # Panics
    /// If `n` is 0.
    pub fn wilson(mean: f64, n: usize) -> Self {
        assert!(n > 0, "a share needs at least one trial");
        let [ci95_low, ci95_high] = tactnet_plot::wilson(mean, n);
        Self {
            mean,
            ci95_low,
            ci95_high,
            n,
        }
    }
}

/// Accuracy on fused sweeps, for two fusion rules.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FusedAccuracy {
    /// Number of sweeps fused into one decision.
    pub sweeps: usize,
    /// Number of materials with enough test sweeps; the others are left out.
    pub materials: usize,
    /// Accuracy of Bayesian fusion, which adds log-probabilities.
    pub bayes: Estimate,
    /// Accuracy of a majority vote with one vote per sweep.
    pub majority: Estimate,
}

impl FusedAccuracy {
    /// Number of random groupings of the test sweeps of a material.
    pub const GROUPINGS: usize = 20;
}

impl Predictions {
    /// Returns the accuracy on single sweeps.
    ///
    /// # Panics
    /// If the predictions are empty.
    pub fn one_sweep(&self) -> Estimate {
        Estimate::wilson(self.accuracy(), self.sweeps.len())
    }

    /// Returns the balanced accuracy on single sweeps: the mean of the materials' recalls (Brodersen et al., 2010).
    ///
    /// The interval is Wilson's for the number of sweeps of equal materials whose mean would vary as much. Materials without a test sweep do
    /// not count.
    ///
    /// # Panics
    /// If the predictions are empty.
    pub fn balanced(&self) -> Estimate {
        let confusion = self.confusion();
        let tested = || {
            let counts = confusion.iter().enumerate();
            let counts = counts.map(|(label, row)| (row[label], row.iter().sum::<usize>()));
            counts.filter(|(_, all)| *all > 0)
        };
        let materials = tested().count() as f64;
        let recall = |(right, all): (usize, usize)| right as f64 / all as f64;
        let mean = tested().map(recall).sum::<f64>() / materials;
        // One right and one wrong sweep more, so that a recall of 0 or 1 has a variance.
        let variance = |(right, all): (usize, usize)| {
            let share = (right + 1) as f64 / (all + 2) as f64;
            share * (1.0 - share) / all as f64
        };
        let of_mean = tested().map(variance).sum::<f64>() / materials.powi(2);
        let pooled = tested().map(|(right, all)| (right + 1) as f64 / (all + 2) as f64);
        let pooled = pooled.sum::<f64>() / materials;
        let sweeps = (pooled * (1.0 - pooled) / of_mean).round() as usize;
        Estimate::wilson(mean, sweeps.clamp(1, self.sweeps.len()))
    }

    /// Returns the accuracy of always naming the material with the most sweeps.
    pub fn guessing(&self) -> f64 {
        let most = self.confusion().iter().map(|row| row.iter().sum()).max();
        most.unwrap_or(0_usize) as f64 / self.sweeps.len() as f64
    }

    /// Returns the accuracy on groups of `sweeps` test sweeps of one material; `None` if no material has that many.
    ///
    /// The sweeps of every material are split at random into disjoint groups, 20 times (stream "fusion" of `seed`). The mean is over all groups.
    /// The interval uses the number of groups of one split, since the splits share sweeps.
    pub fn fused(&self, sweeps: usize, seed: Seed) -> Option<FusedAccuracy> {
        let mut groups = 0;
        let (mut bayes, mut majority) = (0, 0);
        let mut materials = 0;
        for label in 0..self.labels.len() {
            let grouped = self.grouped(label, sweeps, seed);
            materials += usize::from(!grouped.is_empty());
            for scores in &grouped {
                bayes += usize::from(self.fused_label(scores) == label);
                majority += usize::from(majority_vote(scores) == label);
                groups += 1;
            }
        }
        (groups > 0).then(|| {
            let share = |right: usize| {
                Estimate::wilson(
                    right as f64 / groups as f64,
                    groups / FusedAccuracy::GROUPINGS,
                )
            };
            FusedAccuracy {
                sweeps,
                materials,
                bayes: share(bayes),
                majority: share(majority),
            }
        })
    }

    /// Returns counts `[true][predicted]` of the groups of [`Predictions::fused`] with Bayesian fusion. Every sweep counts about 20 times, once
    /// per split.
    pub fn fused_confusion(&self, sweeps: usize, seed: Seed) -> Vec<Vec<usize>> {
        let row = |label| {
            let mut counts = vec![0; self.labels.len()];
            for scores in self.grouped(label, sweeps, seed) {
                counts[self.fused_label(&scores)] += 1;
            }
            counts
        };
        (0..self.labels.len()).map(row).collect()
    }

    /// Returns the log-probabilities of the sweeps of `label`, split at random into groups of `sweeps`, 20 times.
    fn grouped(&self, label: usize, sweeps: usize, seed: Seed) -> Vec<Vec<&[f64]>> {
        let own: Vec<&SweepScore> = self.sweeps.iter().filter(|s| s.label == label).collect();
        let mut grouped = Vec::new();
        for grouping in 0..FusedAccuracy::GROUPINGS {
            let mut order: Vec<usize> = (0..own.len()).collect();
            shuffle(&mut order, &mut seed.rng(("fusion", label, grouping)));
            for group in order.chunks_exact(sweeps.max(1)) {
                let score = |i: &usize| own[*i].log_probability.as_slice();
                grouped.push(group.iter().map(score).collect());
            }
        }
        grouped
    }

    /// Returns the most probable label after adding the log-probabilities.
    fn fused_label(&self, scores: &[&[f64]]) -> usize {
        let mut belief = Belief::flat(self.labels.len());
        scores.iter().for_each(|score| belief.fuse(score));
        belief.label()
    }

    /// Returns the mean negative log-likelihood of the true label, in nats.
    pub fn negative_log_likelihood(&self) -> f64 {
        let total: f64 = self
            .sweeps
            .iter()
            .map(|s| -s.log_probability[s.label])
            .sum();
        // Rounding may leave a value slightly below zero, or minus zero.
        (total / self.sweeps.len() as f64).max(0.0) + 0.0
    }

    /// Returns the mean squared distance between the probabilities and the true one-hot vector, 0 to 2 (Brier, 1950).
    pub fn brier(&self) -> f64 {
        let total: f64 = self
            .sweeps
            .iter()
            .flat_map(|s| {
                s.log_probability.iter().enumerate().map(|(label, log_p)| {
                    (log_p.exp() - f64::from(u8::from(label == s.label))).powi(2)
                })
            })
            .sum();
        total / self.sweeps.len() as f64
    }

    /// Returns the expected calibration error of the largest probability over 15 bins of equal width (Guo et al., 2017).
    pub fn expected_calibration_error(&self) -> f64 {
        const BINS: usize = 15;
        let mut bins = [(0.0_f64, 0.0_f64); BINS];
        for sweep in &self.sweeps {
            let label = sweep.predicted();
            let confidence = sweep.log_probability[label].exp();
            let bin = ((confidence * BINS as f64).ceil() as usize).clamp(1, BINS) - 1;
            bins[bin].0 += confidence;
            bins[bin].1 += f64::from(u8::from(label == sweep.label));
        }
        bins.iter()
            .map(|(confidence, right)| (confidence - right).abs())
            .sum::<f64>()
            / self.sweeps.len() as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PredictionMethod;
    use tactnet_data::LabelSet;

    fn predictions(rows: &[(usize, [f64; 2])]) -> Predictions {
        Predictions {
            labels: LabelSet::new(["cork", "denim"]).unwrap(),
            method: PredictionMethod::Plain,
            sweeps: rows
                .iter()
                .enumerate()
                .map(|(index, (label, p))| SweepScore {
                    index,
                    label: *label,
                    log_probability: p.map(f64::ln).to_vec(),
                })
                .collect(),
        }
    }

    #[test]
    fn wilson_interval_matches_statsmodels() {
        // statsmodels.stats.proportion.proportion_confint(18, 20, method="wilson")
        let estimate = Estimate::wilson(0.9, 20);
        assert!(
            (estimate.ci95_low - 0.698_966_4).abs() < 1e-6,
            "{estimate:?}"
        );
        assert!(
            (estimate.ci95_high - 0.972_133_5).abs() < 1e-6,
            "{estimate:?}"
        );
        let perfect = Estimate::wilson(1.0, 10);
        assert!(
            perfect.ci95_low < 0.75 && perfect.ci95_high == 1.0,
            "{perfect:?}"
        );
    }

    /// sklearn.metrics.balanced_accuracy_score([0, 0, 0, 0, 0, 0, 1, 1], [0, 0, 0, 0, 0, 1, 1, 0]) is 2/3.
    #[test]
    fn balanced_accuracy_matches_scikit_learn_and_equals_accuracy_for_equal_materials() {
        let (right, wrong) = ([0.9, 0.1], [0.1, 0.9]);
        let mut rows = vec![(0, right); 5];
        rows.extend([(0, wrong), (1, wrong), (1, right)]);
        let unequal = predictions(&rows);
        assert!((unequal.balanced().mean - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(unequal.guessing(), 0.75);
        let (wide, narrow) = (unequal.balanced(), unequal.one_sweep());
        assert!(wide.ci95_high - wide.ci95_low > narrow.ci95_high - narrow.ci95_low);

        let equal = predictions(&[
            (0, right),
            (0, right),
            (0, wrong),
            (1, wrong),
            (1, wrong),
            (1, right),
        ]);
        assert_eq!(equal.balanced(), equal.one_sweep());
        assert_eq!(equal.guessing(), 0.5);
    }

    #[test]
    fn calibration_figures_match_hand_computed_values() {
        let p = predictions(&[
            (0, [0.9, 0.1]),
            (0, [0.9, 0.1]),
            (1, [0.9, 0.1]),
            (1, [0.2, 0.8]),
        ]);
        assert_eq!(p.accuracy(), 0.75);
        assert_eq!(p.confusion(), [[2, 0], [1, 1]]);
        let nll = -(0.9_f64.ln() * 2.0 + 0.1_f64.ln() + 0.8_f64.ln()) / 4.0;
        assert!((p.negative_log_likelihood() - nll).abs() < 1e-12);
        let brier = (2.0 * 0.02 + 2.0 * 0.81 + 2.0 * 0.04) / 4.0;
        assert!((p.brier() - brier).abs() < 1e-12);
        let ece = ((3.0 * 0.9 - 2.0_f64).abs() + (0.8 - 1.0_f64).abs()) / 4.0;
        assert!((p.expected_calibration_error() - ece).abs() < 1e-12);
    }

    #[test]
    fn three_sweeps_beat_one_and_groups_are_counted_once() {
        let rows: Vec<(usize, [f64; 2])> = (0..30)
            .flat_map(|i| {
                let p = if i % 3 == 0 { [0.4, 0.6] } else { [0.8, 0.2] };
                [(0, p), (1, [p[1], p[0]])]
            })
            .collect();
        let p = predictions(&rows);
        let fused = p.fused(3, Seed(1)).unwrap();
        assert_eq!(fused.bayes.n, 20);
        assert!(fused.bayes.mean > p.accuracy(), "{fused:?}");
        assert_eq!(
            p.fused(3, Seed(1)),
            Some(fused),
            "the same seed gives the same groups"
        );
        assert!(p.fused(31, Seed(1)).is_none());
        let single = p.fused(1, Seed(1)).unwrap();
        assert!((single.bayes.mean - p.accuracy()).abs() < 1e-12);
        assert!((single.majority.mean - p.accuracy()).abs() < 1e-12);

        let counts = p.fused_confusion(3, Seed(1));
        let all: usize = counts.iter().flatten().sum();
        assert_eq!(all, 20 * fused.bayes.n);
        let right = (counts[0][0] + counts[1][1]) as f64 / all as f64;
        assert!((right - fused.bayes.mean).abs() < 1e-12, "{counts:?}");
        assert_eq!(p.fused_confusion(31, Seed(1)), [[0, 0], [0, 0]]);
    }

    /// Two of three sweeps favour the wrong label slightly, one the right label strongly. All three fused are right; groups that repeat a wrong
    /// sweep may not be.
    #[test]
    fn no_sweep_is_fused_with_itself() {
        let p = predictions(&[(0, [0.4, 0.6]), (0, [0.4, 0.6]), (0, [0.8, 0.2])]);
        let fused = p.fused(3, Seed(1)).unwrap();
        assert_eq!((fused.bayes.mean, fused.bayes.n), (1.0, 1));
        assert_eq!(fused.majority.mean, 0.0);
    }
}
