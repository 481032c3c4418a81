//! Fitted baselines: features, scaling and classifier in sequence.

use tactnet_data::SweepView;
use tactnet_models::Weights;

use super::method::{FittedMethod, Stored};
use crate::features::extractor::Extractor;
use crate::features::scaler::Scaler;
use crate::{BaselineRecipe, ClassifierConfig, FeatureScaling, PipelineError};

/// Fitted baseline.
pub(crate) struct Baseline {
    pub extractor: Extractor,
    pub scaler: Option<Scaler>,
    pub classifier: Box<dyn FittedMethod>,
}

impl Baseline {
    /// Returns log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(&self, view: &SweepView<'_>) -> Vec<Vec<f64>> {
        let mut features = self.extractor.features(view);
        if let Some(scaler) = &self.scaler {
            scaler.apply(&mut features);
        }
        self.classifier.log_probabilities(&features)
    }

    /// Returns all fitted numbers, by name.
    pub fn to_weights(&self) -> Weights {
        let mut weights = Weights::default();
        self.extractor.save(&mut weights);
        if let Some(scaler) = &self.scaler {
            scaler.save(&mut weights);
        }
        self.classifier.save(&mut weights);
        weights
    }

    /// Restores a baseline from [`Baseline::to_weights`].
    ///
    /// # Errors
    /// Arrays that are missing or of another length.
    pub fn from_weights(
        recipe: &BaselineRecipe,
        config: &ClassifierConfig,
        weights: &Weights,
    ) -> Result<Self, PipelineError> {
        let extractor = Extractor::load(
            recipe.features,
            recipe.levels,
            config.shape,
            config.sample_rate_hz,
            weights,
        )?;
        let width = extractor.width();
        let classifier = recipe.classifier.method().load(&Stored {
            weights,
            width,
            materials: config.labels.len(),
        })?;
        let scaler = match recipe.scaling {
            FeatureScaling::Raw => None,
            FeatureScaling::Standard => {
                Some(Scaler::load(weights, width, extractor.hydra_width())?)
            }
        };
        Ok(Self {
            extractor,
            scaler,
            classifier,
        })
    }
}
