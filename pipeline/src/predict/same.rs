//! Probability that two objects are of the same material, by Bayes's rule on their predictions.

use serde::Serialize;
use tactnet_data::LabelSet;

use crate::{ClassifiedObject, ClassifiedSweeps, PredictionMethod};

/// Returns the probability that two objects are of different materials, given the logarithms of their posteriors.
///
/// `s = sum_m a_m b_m` is the probability that labels drawn from both agree; it is `1 / K` if nothing is known. Half of all pairs are taken to be
/// of one material. With uniform priors `p(x_a, x_b | same) ~ s / K` and `p(x_a, x_b | different) ~ (1 - s) / (K (K - 1))`, so that
///
/// ```text
/// P(different) = (1 - s) / ((1 - s) + (K - 1) s)
/// ```
///
/// - `a`, `b`: `[materials]`
pub fn probability_of_different_materials(a: &[f64], b: &[f64]) -> f64 {
    let same: f64 = a.iter().zip(b).map(|(a, b)| (a + b).exp()).sum();
    let apart = (1.0 - same).max(0.0);
    apart / (apart + (a.len() as f64 - 1.0) * same)
}

/// Two objects with the probability that they are of the same material.
#[derive(Debug, Clone, Serialize)]
pub struct SameMaterial {
    /// Version of this layout.
    pub schema_version: u32,
    /// Prediction method.
    pub method: PredictionMethod,
    /// Names of the materials, in the order of the probabilities.
    pub materials: LabelSet,
    /// Names of the two data sets.
    pub data: [String; 2],
    /// Material that each data set names, if it names exactly one.
    pub named: [Option<String>; 2],
    /// Prediction for each object.
    pub objects: [ClassifiedObject; 2],
    /// Probability that both are of the same material, with equal prior probabilities of same and different. It holds for materials that the
    /// classifier knows.
    pub same: f64,
    /// Warnings about the range of the values.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub cautions: Vec<String>,
}

impl SameMaterial {
    /// Compares two sets of sweeps, each classified as one object by the same classifier; `None` if one has no prediction for an object.
    pub fn of(found: [ClassifiedSweeps; 2]) -> Option<Self> {
        let named = found
            .each_ref()
            .map(|sweeps| sweeps.only_name().map(str::to_owned));
        let [first, second] = found;
        let objects = [first.object?, second.object?];
        let [a, b] = objects.each_ref().map(|object| {
            let rows = object.probabilities.iter();
            rows.map(|p| p.ln()).collect::<Vec<f64>>()
        });
        Some(Self {
            schema_version: 1,
            method: first.method,
            materials: first.materials,
            data: [first.data, second.data],
            same: 1.0 - probability_of_different_materials(&a, &b),
            objects,
            named,
            cautions: [first.caution, second.caution]
                .into_iter()
                .flatten()
                .collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn logs(p: &[f64]) -> Vec<f64> {
        p.iter().map(|p| p.ln()).collect()
    }

    #[test]
    fn flat_posteriors_are_undecided_and_certain_ones_decide() {
        for materials in [2, 5, 36] {
            let flat = vec![(1.0 / materials as f64).ln(); materials];
            let found = probability_of_different_materials(&flat, &flat);
            assert!((found - 0.5).abs() < 1e-12, "{materials}");
        }
        let [glass, felt] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]].map(|p| logs(&p));
        assert_eq!(probability_of_different_materials(&glass, &glass), 0.0);
        assert_eq!(probability_of_different_materials(&glass, &felt), 1.0);
    }

    /// Sums the joint posterior of both labels term by term, with half of the pairs of one material.
    #[test]
    fn the_rule_is_the_sum_over_all_pairs_of_labels() {
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
        let found = probability_of_different_materials(&logs(&a), &logs(&b));
        assert!((found - apart / (same + apart)).abs() < 1e-12, "{found}");
    }
}
