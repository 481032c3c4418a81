//! Fit of a baseline to training sweeps.

use std::collections::BTreeMap;

use tactnet_data::{Seed, TrainSplit};
use tactnet_models::Weights;

use super::fitted::Baseline;
use super::method::{Fit, TrainFeatures};
use crate::features::extractor::Extractor;
use crate::features::normalize::taxel_medians;
use crate::{BaselineRecipe, DeadTaxels, PipelineError};

/// Result of fitting a baseline.
#[derive(Debug, Clone)]
pub struct BaselineFit {
    /// All fitted numbers, by name; [`Classifier::new`](crate::Classifier::new) reads them.
    pub weights: Weights,
    /// Settings selected on the inner split or by leave-one-out, by name.
    pub chosen: BTreeMap<String, f64>,
}

/// Fits `recipe` to training sweeps.
///
/// Settings are selected and probabilities calibrated on inner splits of the training sweeps; test sweeps are never read. The votes of a
/// support vector machine's pairs select its settings. Biases of random kernels and the scaling of their features are fitted to all
/// training sweeps, including those that calibrate.
///
/// - `progress`: called with a description of each step
///
/// # Errors
/// Sweeps too short for the features; too few sweeps for the inner split; weights of the sweeps that the classifier cannot use; a solver that
/// fails.
pub fn fit_baseline(
    recipe: &BaselineRecipe,
    sweeps: &TrainSplit<'_>,
    seed: Seed,
    mut progress: impl FnMut(String),
) -> Result<BaselineFit, PipelineError> {
    if sweeps.weights().is_some() && !recipe.takes_weights() {
        return Err(PipelineError::SampleWeights {
            model: recipe.name.clone(),
        });
    }
    progress(format!("features of {} training sweeps …", sweeps.len()));
    let extractor = Extractor::fit(recipe.features, recipe.levels, sweeps, seed)?;
    let train = TrainFeatures {
        sweeps,
        features: extractor.features(sweeps, &DeadTaxels::default()),
        labels: sweeps.labels().collect(),
        materials: sweeps.dataset().labels().len(),
        sparse: extractor.hydra_width(),
        scaling: recipe.scaling,
        seed,
    };
    let Fit {
        classifier,
        scaler,
        chosen,
    } = recipe.classifier.method().fit(train, &mut progress)?;
    let baseline = Baseline {
        extractor,
        scaler,
        classifier,
        medians: taxel_medians(sweeps),
        dead: DeadTaxels::default(),
    };
    Ok(BaselineFit {
        weights: baseline.to_weights(),
        chosen,
    })
}
