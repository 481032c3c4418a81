//! Interface of the classifiers on features: fit, score, save, load.

use std::collections::BTreeMap;

use tactnet_data::{Seed, TrainSplit};
use tactnet_models::{Features, LinearHead, Weights, log_softmax};

use crate::error::InvalidSetting;
use crate::features::arrays::{get, get_doubles, of_length};
use crate::features::scaler::Scaler;
use crate::{FeatureScaling, PipelineError};

/// Settings of a classifier on features, with which it is fitted or loaded.
pub(super) trait Method {
    /// Validates the settings.
    ///
    /// # Errors
    /// An empty list; a value out of range.
    fn validate(&self) -> Result<(), InvalidSetting>;

    /// Returns a material that has too few training sweeps and the number needed; `None` if all have enough.
    ///
    /// By default two of each material are needed: one for fitting, one for selecting settings or calibrating.
    ///
    /// - `counts`: number of training sweeps of each material
    fn starved(&self, counts: &[usize]) -> Option<(usize, usize)> {
        fewest(counts)
            .filter(|label| counts[*label] < 2)
            .map(|label| (label, 2))
    }

    /// Returns true if the fit uses the weights of the training sweeps.
    fn takes_weights(&self) -> bool {
        false
    }

    /// Fits the classifier. Settings are selected and probabilities calibrated on inner splits of the training sweeps.
    ///
    /// - `progress`: called with a description of each step
    ///
    /// # Errors
    /// Too few sweeps for the inner split; a solver that fails.
    fn fit(
        &self,
        train: TrainFeatures<'_>,
        progress: &mut dyn FnMut(String),
    ) -> Result<Fit, PipelineError>;

    /// Loads what [`FittedMethod::save`] has written.
    ///
    /// # Errors
    /// Arrays that are missing or of another length.
    fn load(&self, stored: &Stored<'_>) -> Result<Box<dyn FittedMethod>, PipelineError>;
}

/// Fitted classifier on features.
pub(crate) trait FittedMethod: Send + Sync {
    /// Returns log-probabilities `[sweeps][materials]`.
    fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>>;

    /// Writes the fitted numbers into `weights`.
    fn save(&self, weights: &mut Weights);

    /// Returns the classifier as softmax regression; `None` if it is not linear.
    fn as_linear(&self) -> Option<&dyn LinearMethod> {
        None
    }
}

/// Fitted classifier whose log-probabilities are the softmax of linear scores.
pub(crate) trait LinearMethod {
    /// Returns weights and biases of the scores.
    fn head(&self) -> LinearHead;

    /// Writes another head in place of that of this classifier into `weights`.
    fn save_head(&self, head: &LinearHead, weights: &mut Weights);
}

/// Result of [`Method::fit`].
pub(super) struct Fit {
    pub(super) classifier: Box<dyn FittedMethod>,
    pub(super) scaler: Option<Scaler>,
    /// Selected settings, by name.
    pub(super) chosen: BTreeMap<String, f64>,
}

/// Returns the label with the fewest sweeps.
pub(super) fn fewest(counts: &[usize]) -> Option<usize> {
    (0..counts.len()).min_by_key(|label| counts[*label])
}

/// Returns true if there are values and all are positive and finite.
pub(super) fn are_positive(values: &[f64]) -> bool {
    !values.is_empty() && values.iter().all(|v| v.is_finite() && *v > 0.0)
}

/// Training sweeps of a fold, with their features before scaling.
pub(super) struct TrainFeatures<'a> {
    pub(super) sweeps: &'a TrainSplit<'a>,
    pub(super) features: Features,
    pub(super) labels: Vec<usize>,
    /// Number of materials.
    pub(super) materials: usize,
    /// Number of features at the end that have Hydra's sparse scaling.
    pub(super) sparse: usize,
    pub(super) scaling: FeatureScaling,
    /// Seed of random choices.
    pub(super) seed: Seed,
}

/// Scaled features of training sweeps with their labels.
#[derive(Clone)]
pub(super) struct Labelled {
    pub(super) features: Features,
    pub(super) labels: Vec<usize>,
}

/// Positions among the training sweeps on both sides of an inner split.
pub(super) struct InnerSplit {
    pub(super) fit: Vec<usize>,
    pub(super) held: Vec<usize>,
}

impl TrainFeatures<'_> {
    /// Returns the scaler fitted to `features`, if the recipe scales them.
    pub(super) fn scaler(&self, features: &Features) -> Option<Scaler> {
        match self.scaling {
            FeatureScaling::Raw => None,
            FeatureScaling::Standard => Some(Scaler::fit(features, self.sparse)),
        }
    }

    /// Returns the scaled features of all training sweeps, and their scaler.
    pub(super) fn all(&self) -> (Labelled, Option<Scaler>) {
        let everything: Vec<usize> = (0..self.labels.len()).collect();
        let mut features = self.features.select(&everything);
        let scaler = self.scaler(&features);
        if let Some(scaler) = &scaler {
            scaler.apply(&mut features);
        }
        let labels = self.labels.clone();
        (Labelled { features, labels }, scaler)
    }

    /// Returns both sides of an inner split. The scaler is fitted to the first side and applied to both.
    pub(super) fn sides(&self, split: &InnerSplit) -> [Labelled; 2] {
        let mut fitted = self.features.select(&split.fit);
        let mut held = self.features.select(&split.held);
        if let Some(scaler) = self.scaler(&fitted) {
            scaler.apply(&mut fitted);
            scaler.apply(&mut held);
        }
        let labels_of = |positions: &[usize]| positions.iter().map(|&p| self.labels[p]).collect();
        [
            Labelled {
                features: fitted,
                labels: labels_of(&split.fit),
            },
            Labelled {
                features: held,
                labels: labels_of(&split.held),
            },
        ]
    }

    /// Returns the inner split that holds out part `part`.
    pub(super) fn inner(&self, part: usize) -> Result<InnerSplit, PipelineError> {
        let (fit, held) = self.sweeps.inner(part)?;
        let all = self.sweeps.indices();
        let positions = |indices: &[usize]| -> Vec<usize> {
            let found = indices
                .iter()
                .filter_map(|index| all.binary_search(index).ok());
            found.collect()
        };
        Ok(InnerSplit {
            fit: positions(fit.indices()),
            held: positions(held.indices()),
        })
    }

    /// Returns the candidate with the most correct predictions on the held-out side of the first inner split; the first among equals. A single
    /// candidate is not tried.
    ///
    /// - `predict`: predicts the labels of held-out features with a candidate fitted to labelled features
    pub(super) fn choose<T: Copy>(
        &self,
        candidates: &[T],
        progress: &mut dyn FnMut(String),
        predict: impl Fn(T, Labelled, &Features) -> Result<Vec<usize>, PipelineError>,
    ) -> Result<T, PipelineError> {
        if let [only] = candidates {
            return Ok(*only);
        }
        let [fitted, held] = self.sides(&self.inner(0)?);
        let mut best: Option<(usize, T)> = None;
        for (number, candidate) in candidates.iter().enumerate() {
            let predicted = predict(*candidate, fitted.clone(), &held.features)?;
            let pairs = predicted.iter().zip(&held.labels);
            let correct = pairs.filter(|(a, b)| a == b).count();
            progress(format!(
                "inner split, setting {}/{}: {:.1} %",
                number + 1,
                candidates.len(),
                100.0 * correct as f64 / held.labels.len() as f64
            ));
            if best.as_ref().is_none_or(|(most, _)| correct > *most) {
                best = Some((correct, *candidate));
            }
        }
        best.map(|(_, candidate)| candidate)
            .ok_or(PipelineError::Recipe {
                origin: "of a baseline".into(),
                reason: "no setting to choose from".into(),
            })
    }
}

/// Saved numbers of a baseline.
pub(super) struct Stored<'a> {
    pub(super) weights: &'a Weights,
    /// Number of features.
    pub(super) width: usize,
    /// Number of materials.
    pub(super) materials: usize,
}

impl Stored<'_> {
    /// Returns an array as feature vectors.
    pub(super) fn features(&self, name: &str) -> Result<Features, PipelineError> {
        let values = get(self.weights, name)?.values.clone();
        of_length(
            name,
            values.len(),
            values.len().next_multiple_of(self.width),
        )?;
        Ok(Features::new(self.width, values))
    }

    /// Returns an array of double-precision numbers of the expected length.
    pub(super) fn doubles(&self, name: &str, length: usize) -> Result<Vec<f64>, PipelineError> {
        let values = get_doubles(self.weights, name)?;
        of_length(name, values.len(), length)?;
        Ok(values)
    }

    /// Returns a single number.
    pub(super) fn number(&self, name: &str) -> Result<f64, PipelineError> {
        Ok(self.doubles(name, 1)?[0])
    }
}

/// Returns the log-softmax of scores multiplied by an inverse temperature.
pub(super) fn tempered(scores: &[f64], inverse_temperature: f64) -> Vec<f64> {
    let scaled: Vec<f32> = scores
        .iter()
        .map(|score| (score * inverse_temperature) as f32)
        .collect();
    log_softmax(&scaled)
}
