//! Accuracy on materials that do not coincide with recording blocks.

use serde::{Deserialize, Serialize};
use tactnet_data::{Confounding, Dataset};

use crate::{Estimate, Predictions};

/// Evaluation of a data set in which some materials coincide with recording blocks: the accuracy on their sweeps cannot be told from
/// recognising the recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConfoundedAccuracy {
    /// Names of the materials that were recorded in one block each.
    pub confounded: Vec<String>,
    /// Number of test sweeps of these materials.
    pub n_confounded: usize,
    /// Number of all materials.
    pub materials: usize,
    /// Names of the other materials whose blocks all hold further materials.
    pub unconfounded: Vec<String>,
    /// Accuracy on single sweeps of the unconfounded materials; absent if none was tested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unconfounded_one_sweep: Option<Estimate>,
}

impl ConfoundedAccuracy {
    /// Evaluates predictions of sweeps of `dataset`; returns `None` if no material coincides with a block.
    pub fn of(dataset: &Dataset, predictions: &Predictions) -> Option<Self> {
        let Confounding {
            confounded,
            unconfounded,
            materials,
        } = Confounding::of(dataset)?;
        let named = |labels: Vec<usize>| -> Vec<String> {
            let names = labels.into_iter().map(|label| dataset.labels().name(label));
            names.map(String::from).collect()
        };
        let (confounded, unconfounded) = (named(confounded), named(unconfounded));
        // The classifier may number the materials otherwise than the data set.
        let tested = |names: &[String]| -> Vec<bool> {
            let own = predictions.sweeps.iter();
            let own = own.filter(|sweep| {
                names
                    .iter()
                    .any(|name| name == predictions.labels.name(sweep.label))
            });
            own.map(|sweep| sweep.predicted() == sweep.label).collect()
        };
        let right = tested(&unconfounded);
        let share = right.iter().filter(|right| **right).count() as f64 / right.len().max(1) as f64;
        Some(Self {
            n_confounded: tested(&confounded).len(),
            confounded,
            materials,
            unconfounded_one_sweep: (!right.is_empty())
                .then(|| Estimate::wilson(share, right.len())),
            unconfounded,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PredictionMethod, SweepScore};
    use tactnet_data::{LabelSet, Samples, SweepRecord, SweepShape};

    /// Four floors: `a` and `b` were recorded in one session each, `c` and `d` share two.
    fn floors() -> Dataset {
        let sweeps = [
            (0, 0),
            (0, 0),
            (1, 1),
            (1, 1),
            (2, 2),
            (2, 3),
            (3, 2),
            (3, 3),
        ];
        let record = |(sweep, (label, block))| SweepRecord {
            label,
            sweep,
            block: Some(block),
            test: None,
        };
        let records = sweeps.into_iter().enumerate().map(record).collect();
        let shape = SweepShape {
            steps: 1,
            rows: 1,
            cols: 1,
        };
        let labels = LabelSet::new(["a", "b", "c", "d"]).unwrap();
        Dataset::new(
            "floors",
            100.0,
            shape,
            labels,
            records,
            Samples::U8((0..8).collect()),
        )
        .unwrap()
    }

    /// Predictions `(true, predicted)` by a classifier that knows the materials in reverse order.
    fn predictions(of: &[(&str, &str)]) -> Predictions {
        let labels = LabelSet::new(["d", "c", "b", "a"]).unwrap();
        let label = |name: &str| labels.names().position(|own| own == name).unwrap();
        let sweeps = of.iter().enumerate().map(|(index, (truth, predicted))| {
            let mut log_probability = vec![-3.0; 4];
            log_probability[label(predicted)] = -0.2;
            SweepScore {
                index,
                label: label(truth),
                log_probability,
            }
        });
        Predictions {
            sweeps: sweeps.collect(),
            labels: labels.clone(),
            method: PredictionMethod::Plain,
        }
    }

    #[test]
    fn sweeps_of_materials_with_a_session_of_their_own_do_not_count() {
        let all_right = [
            ("a", "a"),
            ("b", "b"),
            ("c", "d"),
            ("c", "c"),
            ("d", "d"),
            ("d", "c"),
        ];
        let found = ConfoundedAccuracy::of(&floors(), &predictions(&all_right)).unwrap();
        assert_eq!(found.confounded, ["a", "b"]);
        assert_eq!(found.unconfounded, ["c", "d"]);
        assert_eq!((found.n_confounded, found.materials), (2, 4));
        // Four of six are right in all, two of four without `a` and `b`.
        assert_eq!(found.unconfounded_one_sweep, Some(Estimate::wilson(0.5, 4)));
        let text = serde_json::to_string(&found).unwrap();
        assert_eq!(
            serde_json::from_str::<ConfoundedAccuracy>(&text).unwrap(),
            found
        );

        let found = ConfoundedAccuracy::of(&floors(), &predictions(&[("a", "a")])).unwrap();
        assert_eq!(found.unconfounded_one_sweep, None);
    }

    #[test]
    fn sweeps_without_blocks_have_no_confounded_accuracy() {
        let labels = floors().labels().clone();
        let records = floors().records().to_vec();
        let records = records.into_iter().map(|record| SweepRecord {
            block: None,
            ..record
        });
        let samples = Samples::U8((0..8).collect());
        let without = Dataset::new(
            "floors",
            100.0,
            floors().shape(),
            labels,
            records.collect(),
            samples,
        );
        assert!(ConfoundedAccuracy::of(&without.unwrap(), &predictions(&[("a", "a")])).is_none());
    }
}
