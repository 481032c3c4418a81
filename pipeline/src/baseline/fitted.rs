//! Fitted baselines: features, scaling and classifier in sequence.

use tactnet_data::SweepView;
use tactnet_models::{Features, Weights};

use super::method::{FittedMethod, Stored};
use crate::features::arrays::{of_length, put};
use crate::features::extractor::Extractor;
use crate::features::scaler::Scaler;
use crate::{BaselineRecipe, ClassifierConfig, DeadTaxels, FeatureScaling, PipelineError};

/// Name of the taxels' training medians among the fitted numbers.
const MEDIANS: &str = "taxels.median";

/// Fitted baseline.
pub(crate) struct Baseline {
    pub extractor: Extractor,
    pub scaler: Option<Scaler>,
    pub classifier: Box<dyn FittedMethod>,
    /// Median of each taxel over the training sweeps, in digits; empty in runs of earlier versions.
    pub medians: Vec<f32>,
    /// Masked taxels, which read their medians.
    pub dead: DeadTaxels,
}

impl Baseline {
    /// Returns log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(&self, view: &SweepView<'_>) -> Vec<Vec<f64>> {
        self.classifier
            .log_probabilities(&self.scaled_features(view))
    }

    /// Returns the features of all sweeps before scaling.
    pub fn features(&self, view: &SweepView<'_>) -> Features {
        self.extractor.features(view, &self.dead)
    }

    /// Returns the input of the classifier.
    pub fn scaled_features(&self, view: &SweepView<'_>) -> Features {
        let mut features = self.features(view);
        if let Some(scaler) = &self.scaler {
            scaler.apply(&mut features);
            self.mask_features(&mut features);
        }
        features
    }

    /// Masks these taxels: they read their training medians, and scaled features of these taxels alone become zero, their training mean.
    ///
    /// # Errors
    /// A run of an earlier version, whose medians are unknown.
    pub fn mask(&mut self, dead: &[usize]) -> Result<(), PipelineError> {
        let known = self.medians.len();
        let reading = |&taxel: &usize| Some((taxel, *self.medians.get(taxel)?));
        let readings: Option<_> = dead.iter().map(reading).collect();
        self.dead = DeadTaxels(readings.ok_or_else(|| {
            PipelineError::incompatible(
                "dead taxels",
                "a run that names the median of every taxel; train it again",
                format!("{known} medians, as in runs of earlier versions"),
            )
        })?);
        Ok(())
    }

    /// Sets the scaled features of masked taxels to zero.
    fn mask_features(&self, features: &mut Features) {
        let is_dead = |feature: &usize| {
            let taxel = self.extractor.taxel_of(*feature);
            taxel.is_some_and(|taxel| self.dead.0.contains_key(&taxel))
        };
        let width = self.extractor.width();
        let masked: Vec<usize> = (0..width).filter(is_dead).collect();
        for row in features.values_mut().chunks_exact_mut(width) {
            masked.iter().for_each(|&feature| row[feature] = 0.0);
        }
    }

    /// Returns all fitted numbers, by name.
    pub fn to_weights(&self) -> Weights {
        let mut weights = Weights::default();
        self.extractor.save(&mut weights);
        if let Some(scaler) = &self.scaler {
            scaler.save(&mut weights);
        }
        self.classifier.save(&mut weights);
        put(&mut weights, MEDIANS, self.medians.clone());
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
        let medians = weights.0.get(MEDIANS).map(|array| array.values.clone());
        if let Some(medians) = &medians {
            of_length(MEDIANS, medians.len(), config.shape.taxels())?;
        }
        Ok(Self {
            extractor,
            scaler,
            classifier,
            medians: medians.unwrap_or_default(),
            dead: DeadTaxels::default(),
        })
    }
}
