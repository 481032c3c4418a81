//! Ridge regression on targets of +1 and -1, with calibrated temperature.

use serde::{Deserialize, Serialize};
use tactnet_models::{
    Features, Gram, LinearHead, Ridge, RidgeTargets, Weights, default_penalties,
    fit_inverse_temperature,
};

use super::method::{
    Fit, FittedMethod, LinearMethod, Method, Stored, TrainFeatures, are_positive, tempered,
};
use crate::PipelineError;
use crate::error::InvalidSetting;
use crate::features::arrays::{get, of_length, put, put_doubles};

/// Settings of ridge regression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RidgeRecipe {
    /// Candidate penalties; leave-one-out selects one.
    #[serde(default = "default_penalties")]
    pub penalties: Vec<f64>,
}

/// Ridge classifier with the inverse temperature of its scores.
struct TemperedRidge {
    ridge: Ridge,
    inverse_temperature: f64,
}

impl Method for RidgeRecipe {
    fn validate(&self) -> Result<(), InvalidSetting> {
        if are_positive(&self.penalties) {
            return Ok(());
        }
        Err(InvalidSetting {
            setting: "classifier.penalties",
            expected: "positive numbers",
            found: format!("{:?}", self.penalties),
        })
    }

    fn takes_weights(&self) -> bool {
        true
    }

    /// Weights count in the fit and in the choice of the penalty, but neither in the scaling of the features nor in the calibration.
    fn fit(
        &self,
        mut train: TrainFeatures<'_>,
        progress: &mut dyn FnMut(String),
    ) -> Result<Fit, PipelineError> {
        // Scaled in place, since random-convolution features are large.
        let scaler = train.scaler(&train.features);
        if let Some(scaler) = &scaler {
            scaler.apply(&mut train.features);
        }
        let (features, labels) = (&train.features, &train.labels);
        let targets = RidgeTargets {
            labels,
            materials: train.materials,
            weights: train.sweeps.weights(),
            penalties: &self.penalties,
        };
        progress(format!(
            "scalar products of {} features …",
            features.width()
        ));
        let gram = Gram::of(features);
        progress("calibrating on an inner split …".into());
        let inner = train.inner(0)?;
        let scores = gram.held_out_scores(&inner.fit, &inner.held, targets)?;
        let truth: Vec<usize> = inner
            .held
            .iter()
            .map(|&position| labels[position])
            .collect();
        let inverse_temperature = fit_inverse_temperature(&scores, &truth);
        progress("fitting …".into());
        let ridge = Ridge::fit(features, gram, targets)?;
        let chosen = [
            ("penalty".into(), ridge.penalty),
            ("temperature".into(), 1.0 / inverse_temperature),
        ];
        Ok(Fit {
            classifier: Box::new(TemperedRidge {
                ridge,
                inverse_temperature,
            }),
            scaler,
            chosen: chosen.into(),
        })
    }

    fn load(&self, stored: &Stored<'_>) -> Result<Box<dyn FittedMethod>, PipelineError> {
        let materials = stored.materials;
        let coefficients = get(stored.weights, "ridge.coefficients")?.values.clone();
        of_length(
            "ridge.coefficients",
            coefficients.len(),
            stored.width * materials,
        )?;
        Ok(Box::new(TemperedRidge {
            ridge: Ridge {
                coefficients,
                intercepts: stored.doubles("ridge.intercepts", materials)?,
                penalty: stored.number("ridge.penalty")?,
            },
            inverse_temperature: stored.number("ridge.inverse_temperature")?,
        }))
    }
}

impl FittedMethod for TemperedRidge {
    fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        let scores = self.ridge.scores(features);
        scores
            .iter()
            .map(|row| tempered(row, self.inverse_temperature))
            .collect()
    }

    fn save(&self, weights: &mut Weights) {
        let Self {
            ridge,
            inverse_temperature,
        } = self;
        put(weights, "ridge.coefficients", ridge.coefficients.clone());
        put_doubles(weights, "ridge.intercepts", &ridge.intercepts);
        put_doubles(weights, "ridge.penalty", &[ridge.penalty]);
        put_doubles(
            weights,
            "ridge.inverse_temperature",
            &[*inverse_temperature],
        );
    }
    fn as_linear(&self) -> Option<&dyn LinearMethod> {
        Some(self)
    }
}

impl LinearMethod for TemperedRidge {
    fn head(&self) -> LinearHead {
        let (ridge, scale) = (&self.ridge, self.inverse_temperature);
        let width = ridge.coefficients.len() / ridge.intercepts.len();
        let rows = ridge.coefficients.chunks_exact(width);
        let scaled = |row: &[f32]| row.iter().map(|w| scale * f64::from(*w)).collect();
        LinearHead {
            weights: rows.map(scaled).collect(),
            biases: ridge.intercepts.iter().map(|bias| scale * bias).collect(),
        }
    }

    fn save_head(&self, head: &LinearHead, weights: &mut Weights) {
        let scale = self.inverse_temperature;
        let adapted = Self {
            ridge: Ridge {
                coefficients: head
                    .weights
                    .iter()
                    .flatten()
                    .map(|weight| (weight / scale) as f32)
                    .collect(),
                intercepts: head.biases.iter().map(|bias| bias / scale).collect(),
                penalty: self.ridge.penalty,
            },
            inverse_temperature: scale,
        };
        adapted.save(weights);
    }
}
