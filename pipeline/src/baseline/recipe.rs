//! Recipes of baselines: features, scaling, classifier.

use serde::{Deserialize, Serialize};

use super::extra_trees::ExtraTreesRecipe;
use super::knn::KnnRecipe;
use super::lda::LdaRecipe;
use super::method::Method;
use super::ridge::RidgeRecipe;
use super::svm::SvmRecipe;
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

/// Declares the classifiers on features, one line each.
macro_rules! classifiers {
    ($($(#[$doc:meta])* $name:ident($settings:ty),)*) => {
        /// Classifier on the features. If a list holds several values, the inner 64/16 split selects one.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind", rename_all = "kebab-case")]
        pub enum ClassicalClassifier {
            $($(#[$doc])* $name($settings),)*
        }

        impl ClassicalClassifier {
            /// Returns the settings as a method that can be fitted or loaded.
            pub(super) fn method(&self) -> &dyn Method {
                match self {
                    $(Self::$name(settings) => settings,)*
                }
            }
        }
    };
}

classifiers! {
    /// k nearest neighbours.
    Knn(KnnRecipe),
    /// Support vector machine, one against one, with a radial basis kernel.
    Svm(SvmRecipe),
    /// Linear discriminant analysis with the shrinkage of Ledoit and Wolf.
    Lda(LdaRecipe),
    /// Ridge regression on targets of +1 and -1.
    Ridge(RidgeRecipe),
    /// Extremely randomised trees.
    ExtraTrees(ExtraTreesRecipe),
}

impl BaselineRecipe {
    /// Returns a material that has too few training sweeps for this classifier and the number needed; `None` if all have enough.
    ///
    /// - `counts`: number of training sweeps of each material
    pub(crate) fn starved(&self, counts: &[usize]) -> Option<(usize, usize)> {
        self.classifier.method().starved(counts)
    }

    /// Returns true if the fit uses the weights of the training sweeps.
    pub(crate) fn takes_weights(&self) -> bool {
        self.classifier.method().takes_weights()
    }

    /// Validates names and ranges.
    ///
    /// # Errors
    /// An empty name, an empty list, a value out of range.
    pub(crate) fn validate(&self) -> Result<(), InvalidSetting> {
        if self.name.trim().is_empty() {
            return Err(InvalidSetting {
                setting: "name",
                expected: "a name",
                found: "an empty one".into(),
            });
        }
        self.classifier.method().validate()
    }
}
