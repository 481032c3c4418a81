//! Calibrated thresholds for unknown materials and for prediction sets.
//!
//! Both thresholds are order statistics of scores of held-out sweeps (split conformal prediction: Vovk et al., 2005; Sadinle et al., 2019).
//! Their rates therefore hold for new sweeps of the same materials, whatever the network.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_models::argmax;

use super::judged_sweeps::JudgedSweeps;
use crate::{NoveltyScore, PipelineError, PipelineRemedy};

/// Maximum number of sweeps of one object with a separate threshold.
const OBJECT_SWEEPS: usize = 5;

/// Target error rates of a calibrated classifier.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationTarget {
    /// Maximum share of sweeps of known materials that are called unknown, 0 to 1.
    pub false_alarms: f64,
    /// Minimum share of sweeps whose material is in the prediction set, 0 to 1.
    pub coverage: f64,
}

impl Default for CalibrationTarget {
    fn default() -> Self {
        Self {
            false_alarms: 0.05,
            coverage: 0.9,
        }
    }
}

impl CalibrationTarget {
    /// Succeeds if order statistics of `sweeps` sweeps can guarantee both rates.
    ///
    /// # Errors
    /// Too few sweeps.
    pub fn check(self, sweeps: usize) -> Result<(), PipelineError> {
        let needed = self.least_sweeps();
        if sweeps >= needed {
            return Ok(());
        }
        let percent = |share: f64| (1e6 * share).round() / 1e4;
        let possible = 1.0 / (sweeps + 1) as f64 - 1e-9;
        // Rounded up, so that the suggested rate is possible.
        let smallest = (100.0 * possible).ceil() / 100.0;
        Err(PipelineError::TooFewSetAside {
            needed,
            false_alarms_percent: percent(self.false_alarms),
            coverage_percent: percent(self.coverage),
            found: sweeps,
            remedy: if sweeps < 2 {
                PipelineRemedy::RecordMore
            } else {
                PipelineRemedy::RelaxTargets {
                    false_alarms: (self.false_alarms < possible).then_some(smallest),
                    coverage: (1.0 - self.coverage < possible).then_some(1.0 - smallest),
                }
            },
        })
    }

    /// Returns the minimum number of sweeps for both rates: the smallest n with `ceil((n + 1)(1 - share)) <= n`.
    fn least_sweeps(self) -> usize {
        let share = self.false_alarms.min(1.0 - self.coverage);
        (1.0 / share - 1.0 - 1e-9).ceil().max(1.0) as usize
    }
}

/// `calibration.json`: thresholds that guarantee the rates of a [`CalibrationTarget`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Version of this layout.
    pub schema_version: u32,
    /// Rates that the thresholds were fitted for.
    #[serde(alias = "promise")]
    pub target: CalibrationTarget,
    /// Novelty score that detects unknown materials.
    pub score: NoveltyScore,
    /// Novelty score above which a sweep is unknown.
    pub threshold: f64,
    /// Mean novelty scores above which an object is unknown, by its number of sweeps (1, 2, …). Short if there were few sweeps, and empty in files
    /// of earlier versions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub object_thresholds: Vec<f64>,
    /// Minimum probability of a material in the prediction set.
    pub least_probability: f64,
    /// Number of sweeps that the thresholds were fitted to.
    pub sweeps: usize,
}

/// Calibrated assessment of one sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Novelty score; larger for less familiar sweeps.
    pub strangeness: f64,
    /// True if the novelty score is above the threshold.
    pub unknown: bool,
    /// Prediction set: the labels of all plausible materials, at least one.
    pub set: Vec<usize>,
}

impl Calibration {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 1;

    /// Fits the thresholds to held-out sweeps of known materials, to which nothing in the classifier was fitted.
    ///
    /// # Errors
    /// Too few sweeps for the target.
    pub(crate) fn fit(
        target: CalibrationTarget,
        score: NoveltyScore,
        judged: &JudgedSweeps,
    ) -> Result<Self, PipelineError> {
        target.check(judged.labels.len())?;
        let threshold = upper_quantile(&judged.scores, target.false_alarms);
        let object_thresholds = (1..=OBJECT_SWEEPS)
            .map(|sweeps| object_means(&judged.scores, &judged.labels, sweeps))
            .map(|means| upper_quantile(&means, target.false_alarms))
            .take_while(|threshold| threshold.is_finite())
            .collect();
        let least_probability =
            least_probability(&judged.log_probabilities, &judged.labels, target.coverage);
        Ok(Self {
            schema_version: Self::SCHEMA_VERSION,
            target,
            score,
            threshold,
            object_thresholds,
            least_probability,
            sweeps: judged.labels.len(),
        })
    }

    /// Returns a warning if the rate of false alarms may differ from its target by more than the target itself.
    pub fn caution(&self) -> Option<String> {
        let rate = self.target.false_alarms;
        // The rate of a threshold fitted to n sweeps is beta distributed around its target.
        let spread = 1.96 * (rate * (1.0 - rate) / (self.sweeps + 2) as f64).sqrt();
        (spread > rate).then(|| {
            format!(
                "the thresholds are fitted to {} sweeps: for a target of {:.0} % false alarms, 0 to {:.0} % are likely; more sweeps narrow this range",
                self.sweeps,
                100.0 * rate,
                100.0 * (rate + spread)
            )
        })
    }

    /// Returns true if an object is of an unknown material; `None` without sweeps or thresholds.
    ///
    /// - `mean_score`: mean novelty score of its sweeps
    /// - `sweeps`: number of its sweeps; numbers beyond the last threshold use the last one
    pub fn object_is_unknown(&self, mean_score: f64, sweeps: usize) -> Option<bool> {
        let last = self.object_thresholds.len().min(sweeps).checked_sub(1)?;
        Some(mean_score > self.object_thresholds[last])
    }

    /// Returns the verdict on every sweep.
    pub(crate) fn assess(&self, judged: JudgedSweeps) -> Vec<Verdict> {
        let rows = judged.scores.into_iter().zip(judged.log_probabilities);
        rows.map(|(strangeness, log_p)| Verdict {
            strangeness,
            unknown: strangeness > self.threshold,
            set: prediction_set(&log_p, self.least_probability),
        })
        .collect()
    }
}

/// Returns the mean scores of disjoint groups of `sweeps` successive sweeps of one material.
fn object_means(scores: &[f64], labels: &[usize], sweeps: usize) -> Vec<f64> {
    let mut materials: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for (score, label) in scores.iter().zip(labels) {
        materials.entry(*label).or_default().push(*score);
    }
    let objects = materials.values().flat_map(|own| own.chunks_exact(sweeps));
    objects
        .map(|object| object.iter().sum::<f64>() / sweeps as f64)
        .collect()
}

/// Returns the probability that the true materials of at least a share `coverage` of new sweeps reach, estimated from held-out sweeps; minus
/// infinity if they are too few for that guarantee.
///
/// - `log_probabilities`: `[sweeps][materials]`, natural logarithm
pub fn least_probability(log_probabilities: &[Vec<f64>], labels: &[usize], coverage: f64) -> f64 {
    let losses: Vec<f64> = log_probabilities
        .iter()
        .zip(labels)
        .map(|(log_p, label)| 1.0 - log_p[*label].exp())
        .collect();
    1.0 - upper_quantile(&losses, 1.0 - coverage)
}

/// Returns all labels of at least that probability, and the most probable one.
pub fn prediction_set(log_probabilities: &[f64], least_probability: f64) -> Vec<usize> {
    let best = argmax(log_probabilities);
    (0..log_probabilities.len())
        .filter(|&label| {
            label == best || 1.0 - log_probabilities[label].exp() <= 1.0 - least_probability
        })
        .collect()
}

/// Returns the smallest value that at most `share` of `values` exceed, with the finite-sample correction of split conformal prediction: the
/// `ceil((n + 1)(1 - share))`-th smallest of n; infinite if n is too small (Vovk et al., 2005).
pub fn upper_quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = ((sorted.len() + 1) as f64 * (1.0 - share) - 1e-9).ceil() as usize;
    match rank {
        0 => f64::NEG_INFINITY,
        rank => sorted.get(rank - 1).copied().unwrap_or(f64::INFINITY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_former_versions_are_read() {
        let text = r#"{"schema_version": 1, "promise": {"false_alarms": 0.05, "coverage": 0.9}, "score": "energy",
                       "threshold": 1.5, "least_probability": 0.1, "sweeps": 40}"#;
        let calibration: Calibration = serde_json::from_str(text).unwrap();
        assert_eq!(calibration.target, CalibrationTarget::default());
        assert_eq!(calibration.object_is_unknown(9.0, 3), None);
    }

    #[test]
    fn objects_are_of_one_material_and_have_thresholds_by_their_number_of_sweeps() {
        let scores = [1.0, 10.0, 3.0, 20.0, 100.0];
        let labels = [0, 1, 0, 1, 0];
        assert_eq!(
            object_means(&scores, &labels, 1),
            [1.0, 3.0, 100.0, 10.0, 20.0]
        );
        assert_eq!(object_means(&scores, &labels, 2), [2.0, 15.0]);
        assert!(object_means(&scores, &labels, 4).is_empty());
        let calibration = Calibration {
            schema_version: Calibration::SCHEMA_VERSION,
            target: CalibrationTarget::default(),
            score: NoveltyScore::BEST,
            threshold: 5.0,
            object_thresholds: vec![5.0, 4.0],
            least_probability: 0.0,
            sweeps: 5,
        };
        let unknown = [(4.5, 1), (4.5, 2), (4.5, 9), (4.0, 2)]
            .map(|(mean, sweeps)| calibration.object_is_unknown(mean, sweeps));
        assert_eq!(unknown, [Some(false), Some(true), Some(true), Some(false)]);
        assert_eq!(calibration.object_is_unknown(9.0, 0), None);
    }

    #[test]
    fn quantiles_are_those_of_split_conformal_prediction() {
        let values: Vec<f64> = (1..=99).rev().map(f64::from).collect();
        assert_eq!(upper_quantile(&values, 0.05), 95.0);
        assert_eq!(upper_quantile(&values, 0.1), 90.0);
        assert_eq!(upper_quantile(&values[..9], 0.05), f64::INFINITY);
    }

    #[test]
    fn as_many_sweeps_are_asked_for_as_make_the_bounds_finite() {
        for (false_alarms, coverage) in [(0.05, 0.9), (0.2, 0.99), (0.5, 0.5), (0.01, 0.7)] {
            let target = CalibrationTarget {
                false_alarms,
                coverage,
            };
            for sweeps in 0..=120 {
                let values = vec![0.0; sweeps];
                let finite = [false_alarms, 1.0 - coverage]
                    .iter()
                    .all(|share| upper_quantile(&values, *share).is_finite());
                assert_eq!(target.check(sweeps).is_ok(), finite, "{target:?} {sweeps}");
            }
        }
        let coverage = 0.9;
        for (sweeps, false_alarms) in [(16, 0.06), (9, 0.1), (4, 0.2), (12, 0.08)] {
            let strict = CalibrationTarget {
                false_alarms: 0.01,
                coverage,
            };
            let refused = strict.check(sweeps).unwrap_err();
            let needs_both = sweeps < 9;
            let possible = PipelineRemedy::RelaxTargets {
                false_alarms: Some(false_alarms),
                coverage: needs_both.then_some(0.8),
            };
            assert_eq!(refused.pipeline_remedy(), Some(possible));
            let named = CalibrationTarget {
                false_alarms,
                coverage: if needs_both { 0.8 } else { coverage },
            };
            named.check(sweeps).unwrap();
        }
        let refused = CalibrationTarget::default().check(15).unwrap_err();
        assert!(refused.to_string().contains("at least 19"), "{refused}");
    }

    #[test]
    fn a_set_holds_the_best_and_all_that_are_probable_enough() {
        let log_p: Vec<f64> = [0.5_f64, 0.3, 0.2].iter().map(|p| p.ln()).collect();
        assert_eq!(prediction_set(&log_p, 0.25), [0, 1]);
        assert_eq!(prediction_set(&log_p, 0.9), [0]);
        assert_eq!(prediction_set(&log_p, 0.0), [0, 1, 2]);
    }

    #[test]
    fn nine_of_ten_true_materials_reach_the_bound_for_ninety_percent() {
        let log_p: Vec<Vec<f64>> = (1..=19)
            .map(|k| vec![f64::from(k).ln() - 20_f64.ln(), -1.0])
            .collect();
        // The second smallest of 19: (19 + 1) * 0.9 = 18 values are at or above it.
        let bound = least_probability(&log_p, &[0; 19], 0.9);
        assert!((bound - 2.0 / 20.0).abs() < 1e-12, "{bound}");
        assert_eq!(
            least_probability(&log_p[..3], &[0; 3], 0.9),
            f64::NEG_INFINITY
        );
    }
}
