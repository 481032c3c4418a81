//! Accuracy as a function of the length of sweeps.

use serde::{Deserialize, Serialize};
use tactnet_data::Dataset;

use crate::{Estimate, Predictions};

/// Number of groups of about equally many sweeps.
const GROUPS: usize = 4;

/// Accuracy on the sweeps of a quartile of length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LengthAccuracy {
    /// Number of frames of the shortest of these sweeps.
    pub shortest: usize,
    /// Number of frames of the longest of these sweeps.
    pub longest: usize,
    /// Accuracy on single sweeps.
    pub accuracy: Estimate,
}

impl LengthAccuracy {
    /// Returns the accuracy for each quartile of length, the shortest sweeps first; empty if all sweeps of the data set have one length. Sweeps of
    /// one length are in one group, so there may be fewer groups.
    pub fn quartiles(dataset: &Dataset, predictions: &Predictions) -> Vec<Self> {
        if dataset.lengths().is_none() {
            return Vec::new();
        }
        let mut sweeps: Vec<(usize, bool)> = predictions
            .sweeps
            .iter()
            .map(|sweep| {
                (
                    dataset.steps_of(sweep.index),
                    sweep.predicted() == sweep.label,
                )
            })
            .collect();
        sweeps.sort_unstable();
        let mut groups = Vec::new();
        let mut rest = sweeps.as_slice();
        for group in 1..=GROUPS {
            let wanted = group * sweeps.len() / GROUPS;
            let taken = sweeps.len() - rest.len();
            let Some(last) = wanted.checked_sub(taken + 1).map(|at| rest[at].0) else {
                continue;
            };
            let (own, longer) = rest.split_at(rest.partition_point(|sweep| sweep.0 <= last));
            let right = own.iter().filter(|(_, right)| *right).count();
            groups.push(Self {
                shortest: own[0].0,
                longest: last,
                accuracy: Estimate::wilson(right as f64 / own.len() as f64, own.len()),
            });
            rest = longer;
        }
        groups
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PredictionMethod, SweepScore};
    use tactnet_data::{LabelSet, Samples, SweepRecord, SweepShape};

    fn quartiles(
        lengths: &[usize],
        is_right: impl Fn(usize) -> bool,
    ) -> Vec<(usize, usize, usize, f64)> {
        let shape = SweepShape {
            steps: 10,
            rows: 1,
            cols: 1,
        };
        let count = lengths.len();
        let labels = LabelSet::new(["cork", "felt"]).unwrap();
        let records = (0..count).map(|sweep| SweepRecord::new(0, sweep)).collect();
        let samples = Samples::U8(vec![0; 10 * count]);
        let dataset = Dataset::new("lengths", 10.0, shape, labels.clone(), records, samples)
            .and_then(|dataset| dataset.with_lengths(lengths.to_vec()))
            .unwrap();
        let score = |index: usize| SweepScore {
            index,
            label: usize::from(!is_right(index)),
            log_probability: vec![-0.1, -2.0],
        };
        let predictions = Predictions {
            labels,
            method: PredictionMethod::Plain,
            sweeps: (0..count).map(score).collect(),
        };
        LengthAccuracy::quartiles(&dataset, &predictions)
            .into_iter()
            .map(|of| (of.shortest, of.longest, of.accuracy.n, of.accuracy.mean))
            .collect()
    }

    #[test]
    fn quartiles_contain_every_sweep_once_and_equal_lengths_together() {
        assert_eq!(
            quartiles(&[9, 2, 4, 3, 8, 7, 6, 5], |sweep| sweep != 1),
            [
                (2, 3, 2, 0.5),
                (4, 5, 2, 1.0),
                (6, 7, 2, 1.0),
                (8, 9, 2, 1.0)
            ]
        );
        assert_eq!(
            quartiles(&[5, 5, 5, 5, 5, 5, 5, 10], |_| true),
            [(5, 5, 7, 1.0), (10, 10, 1, 1.0)]
        );
        assert_eq!(
            quartiles(&[3, 10], |_| false),
            [(3, 3, 1, 0.0), (10, 10, 1, 0.0)]
        );
        assert!(quartiles(&[5, 5, 5], |_| true).is_empty());
    }
}
