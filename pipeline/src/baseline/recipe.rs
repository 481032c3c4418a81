//! Recipes of baselines: features, scaling, classifier.

use serde::{Deserialize, Serialize};
use tactnet_models::default_penalties;

use crate::error::InvalidSetting;
use crate::{FeatureSet, MeanRemoval};

/// All settings from which a baseline is fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineRecipe {
    /// Name of the recipe.
    pub name: String,
    /// Features computed from a sweep.
    pub features: FeatureSet,
    /// Removal of each taxel's mean over a sweep.
    #[serde(default, skip_serializing_if = "MeanRemoval::is_none")]
    pub levels: MeanRemoval,
    /// Scaling of the features.
    #[serde(default)]
    pub scaling: FeatureScaling,
    /// Classifier on the features.
    pub classifier: ClassicalClassifier,
}

/// Scaling of features before classification.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureScaling {
    /// No scaling.
    #[default]
    Raw,
    /// Mean 0 and standard deviation 1 over the training sweeps; Hydra's features have their own sparse scaling.
    Standard,
}

/// Classifier on the features. If a list holds several values, the inner 64/16 split selects one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ClassicalClassifier {
    /// k nearest neighbours.
    Knn {
        /// Candidates for k.
        neighbours: Vec<usize>,
    },
    /// Support vector machine, one against one, with a radial basis kernel.
    Svm {
        /// Candidates for C.
        c: Vec<f64>,
        /// Candidates for gamma, in multiples of one over the number of features.
        gamma: Vec<f64>,
    },
    /// Linear discriminant analysis with the shrinkage of Ledoit and Wolf.
    Lda,
    /// Ridge regression on targets of +1 and -1.
    Ridge {
        /// Candidate penalties; leave-one-out selects one.
        #[serde(default = "default_penalties")]
        penalties: Vec<f64>,
    },
}

impl BaselineRecipe {
    /// Returns a material that has too few training sweeps for this classifier and the number needed; `None` if all have enough.
    ///
    /// Selecting settings and calibrating need two sweeps of each material: one for fitting, one for evaluation. A covariance needs two sweeps
    /// of any one material. A fixed k needs k sweeps in total.
    ///
    /// - `counts`: number of training sweeps of each material
    pub(crate) fn starved(&self, counts: &[usize]) -> Option<(usize, usize)> {
        let fewest = || (0..counts.len()).min_by_key(|label| counts[*label]);
        match &self.classifier {
            ClassicalClassifier::Knn { neighbours } if neighbours.len() == 1 => {
                let all: usize = counts.iter().sum();
                let least = neighbours[0].div_ceil(counts.len().max(1));
                fewest()
                    .filter(|_| all < neighbours[0])
                    .map(|label| (label, least))
            }
            ClassicalClassifier::Lda if counts.iter().any(|&count| count > 1) => None,
            _ => fewest()
                .filter(|label| counts[*label] < 2)
                .map(|label| (label, 2)),
        }
    }

    /// Validates names and ranges.
    ///
    /// # Errors
    /// An empty name, an empty list, a value out of range.
    pub(crate) fn validate(&self) -> Result<(), InvalidSetting> {
        let positive =
            |values: &[f64]| !values.is_empty() && values.iter().all(|v| v.is_finite() && *v > 0.0);
        let refused = |setting, expected, found| {
            Err(InvalidSetting {
                setting,
                expected,
                found,
            })
        };
        if self.name.trim().is_empty() {
            return refused("name", "a name", "an empty one".into());
        }
        match &self.classifier {
            ClassicalClassifier::Knn { neighbours }
                if neighbours.is_empty() || neighbours.contains(&0) =>
            {
                let found = format!("{neighbours:?}");
                refused("classifier.neighbours", "whole numbers from 1", found)
            }
            ClassicalClassifier::Svm { c, .. } if !positive(c) => {
                refused("classifier.c", "positive numbers", format!("{c:?}"))
            }
            ClassicalClassifier::Svm { gamma, .. } if !positive(gamma) => {
                refused("classifier.gamma", "positive numbers", format!("{gamma:?}"))
            }
            ClassicalClassifier::Ridge { penalties } if !positive(penalties) => {
                let found = format!("{penalties:?}");
                refused("classifier.penalties", "positive numbers", found)
            }
            _ => Ok(()),
        }
    }
}
