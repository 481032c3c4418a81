//! Accuracy of a training on a random fold, beside that on held-out recording blocks.

use serde::{Deserialize, Serialize};
use tactnet_data::{Dataset, Fold, Scheme};

use super::set_aside::set_aside;
use crate::{Device, Estimate, RunConfig, describe_split, fit_model};

/// Accuracy of the same training on a random fold, which has sweeps of the same recordings in training.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RandomFold {
    /// Description of the split.
    pub split: String,
    /// Number of training sweeps.
    pub n_train: usize,
    /// Accuracy on single sweeps with the recipe's prediction method.
    pub one_sweep: Estimate,
}

impl RandomFold {
    /// Trains with the settings of a run on the first random fold, and evaluates the classifier. Nothing is written.
    ///
    /// Returns `None` if the training is stopped or not possible, for example with too few sweeps: the result of the run does not depend
    /// on this accuracy.
    ///
    /// - `stop`: called after every batch of a network; true ends the training
    pub(super) fn measure(
        config: &RunConfig,
        dataset: &Dataset,
        device: &Device,
        stop: &impl Fn() -> bool,
    ) -> Option<Self> {
        let (spec, recipe) = (&config.spec, &config.recipe);
        let fold = Fold::new(dataset, Scheme::folds_for(dataset), spec.seed, 0, 0).ok()?;
        let fold = match spec.shots {
            None => fold,
            Some(shots) => fold.shots(shots).ok()?,
        };
        let (fitted, _) = set_aside(&fold, spec.calibration).ok()?;
        let train = &fitted.train;
        if recipe.starved(&train.sweeps_per_label()).is_some() {
            return None;
        }
        let fitted = fit_model(recipe, train, spec.seed, device, |_| !stop()).ok()??;
        let predictions = fitted
            .classifier
            .predict(&fold.test, recipe.method())
            .ok()?;
        Some(Self {
            split: describe_split(&fold.manifest(), spec),
            n_train: train.len(),
            one_sweep: predictions.one_sweep(),
        })
    }
}
