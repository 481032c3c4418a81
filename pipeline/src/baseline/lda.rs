//! Linear discriminant analysis with the shrinkage of Ledoit and Wolf.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_models::{Features, Lda, LinearHead, Weights};

use super::method::{Fit, FittedMethod, LinearMethod, Method, Stored, TrainFeatures, fewest};
use crate::PipelineError;
use crate::error::InvalidSetting;
use crate::features::arrays::put_doubles;

/// Settings of linear discriminant analysis, which has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LdaRecipe {}

impl Method for LdaRecipe {
    fn validate(&self) -> Result<(), InvalidSetting> {
        Ok(())
    }

    /// The covariance needs two sweeps of any one material.
    fn starved(&self, counts: &[usize]) -> Option<(usize, usize)> {
        if counts.iter().any(|&count| count > 1) {
            return None;
        }
        fewest(counts).map(|label| (label, 2))
    }

    fn takes_weights(&self) -> bool {
        true
    }

    fn fit(
        &self,
        train: TrainFeatures<'_>,
        _progress: &mut dyn FnMut(String),
    ) -> Result<Fit, PipelineError> {
        let (all, scaler) = train.all();
        let weights = train.sweeps.weights();
        let lda = Lda::fit(&all.features, &all.labels, train.materials, weights)?;
        Ok(Fit {
            classifier: Box::new(lda),
            scaler,
            chosen: BTreeMap::new(),
        })
    }

    fn load(&self, stored: &Stored<'_>) -> Result<Box<dyn FittedMethod>, PipelineError> {
        let materials = stored.materials;
        Ok(Box::new(Lda {
            coefficients: stored.doubles("lda.coefficients", stored.width * materials)?,
            intercepts: stored.doubles("lda.intercepts", materials)?,
        }))
    }
}

impl FittedMethod for Lda {
    fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        Self::log_probabilities(self, features)
    }

    fn save(&self, weights: &mut Weights) {
        put_doubles(weights, "lda.coefficients", &self.coefficients);
        put_doubles(weights, "lda.intercepts", &self.intercepts);
    }
    fn as_linear(&self) -> Option<&dyn LinearMethod> {
        Some(self)
    }
}

impl LinearMethod for Lda {
    fn head(&self) -> LinearHead {
        let width = self.coefficients.len() / self.intercepts.len();
        LinearHead {
            weights: self
                .coefficients
                .chunks_exact(width)
                .map(<[f64]>::to_vec)
                .collect(),
            biases: self.intercepts.clone(),
        }
    }

    fn save_head(&self, head: &LinearHead, weights: &mut Weights) {
        let adapted = Self {
            coefficients: head.weights.concat(),
            intercepts: head.biases.clone(),
        };
        adapted.save(weights);
    }
}
