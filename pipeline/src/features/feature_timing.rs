//! Feature extraction without a classifier, for benchmarks.

use tactnet_data::{Seed, SweepView, TrainSplit};
use tactnet_models::Features;

use crate::features::extractor::Extractor;
use crate::{DeadTaxels, FeatureSet, MeanRemoval, PipelineError};

/// Feature extractor of baselines, for measuring its time alone.
#[doc(hidden)]
pub struct FeatureTimer(Extractor);

impl FeatureTimer {
    /// Fits the feature set to training sweeps.
    ///
    /// # Errors
    /// Sweeps that are too short for the feature set.
    pub fn fit(set: FeatureSet, train: &TrainSplit<'_>, seed: Seed) -> Result<Self, PipelineError> {
        Extractor::fit(set, MeanRemoval::None, train, seed).map(Self)
    }

    /// Returns the features of every sweep of `view`: `[sweeps][width]`.
    pub fn transform(&self, view: &SweepView<'_>) -> Features {
        self.0.features(view, &DeadTaxels::default())
    }
}
