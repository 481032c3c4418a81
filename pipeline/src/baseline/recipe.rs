//! How a classical or random-convolution classifier comes about: features, scaling, classifier.

use serde::{Deserialize, Serialize};
use tactnet_models::default_penalties;

use crate::error::InvalidSetting;
use crate::{FeatureSet, MeanRemoval};

/// How a baseline comes about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaselineRecipe {
    /// What people call it.
    pub name: String,
    /// What is computed from a sweep.
    pub features: FeatureSet,
    /// What happens to the mean of each taxel over a sweep.
    #[serde(default, skip_serializing_if = "MeanRemoval::is_none")]
    pub levels: MeanRemoval,
    /// What happens to the features.
    #[serde(default)]
    pub scaling: FeatureScaling,
    /// What reads them.
    pub classifier: ClassicalClassifier,
}

/// What happens to features before a classifier reads them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FeatureScaling {
    /// Nothing.
    #[default]
    Raw,
    /// Mean 0 and standard deviation 1 over the training sweeps (Hydra's features: their own sparse scaling).
    Standard,
}

/// What reads the features. Where a list holds several values, the inner 64/16 split chooses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum ClassicalClassifier {
    /// k nearest neighbours.
    Knn {
        /// Values of k.
        neighbours: Vec<usize>,
    },
    /// Support vector machine, one against one, radial basis kernel.
    Svm {
        /// Values of C.
        c: Vec<f64>,
        /// Values of gamma, in units of one over the number of features.
        gamma: Vec<f64>,
    },
    /// Linear discriminant analysis with the shrinkage of Ledoit and Wolf.
    Lda,
    /// Ridge regression on +1 and -1.
    Ridge {
        /// Penalties to choose from by leave-one-out.
        #[serde(default = "default_penalties")]
        penalties: Vec<f64>,
    },
}

impl BaselineRecipe {
    /// Returns a material with too few training sweeps for this classifier, and how many it takes: settings and calibration take two of every
    /// material, to fit to and to judge by; a covariance takes two of any; neighbours take as many sweeps as there are to be.
    ///
    /// - `counts`: training sweeps of every material
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

    /// # Errors
    /// An empty name, a list without values, a value out of range.
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
