//! Support vector machine, one against one, with a radial basis kernel and Platt's probabilities.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_models::{Features, PlattSigmoids, Svm, SvmSettings, Weights, fit_platt};

use super::method::{Fit, FittedMethod, Method, Stored, TrainFeatures, are_positive};
use crate::PipelineError;
use crate::error::InvalidSetting;
use crate::features::arrays::{
    get, get_doubles, get_indices, get_indices_below, of_length, put, put_doubles, put_indices,
};

/// Settings of a support vector machine.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SvmRecipe {
    /// Candidates for C.
    pub c: Vec<f64>,
    /// Candidates for gamma, in multiples of one over the number of features.
    pub gamma: Vec<f64>,
}

/// Support vector machine with the sigmoids of its pairs.
struct CalibratedSvm {
    svm: Svm,
    sigmoids: PlattSigmoids,
}

impl SvmRecipe {
    /// Returns all combinations of candidates.
    fn grid(&self, width: usize) -> Vec<SvmSettings> {
        self.c
            .iter()
            .flat_map(|&c| {
                self.gamma.iter().map(move |gamma| SvmSettings {
                    c,
                    gamma: gamma / width as f64,
                })
            })
            .collect()
    }
}

impl Method for SvmRecipe {
    fn validate(&self) -> Result<(), InvalidSetting> {
        for (setting, values) in [("classifier.c", &self.c), ("classifier.gamma", &self.gamma)] {
            if !are_positive(values) {
                return Err(InvalidSetting {
                    setting,
                    expected: "positive numbers",
                    found: format!("{values:?}"),
                });
            }
        }
        Ok(())
    }

    fn fit(
        &self,
        train: TrainFeatures<'_>,
        progress: &mut dyn FnMut(String),
    ) -> Result<Fit, PipelineError> {
        let (materials, width) = (train.materials, train.features.width());
        let grid = self.grid(width);
        let settings = train.choose(&grid, progress, |settings, fitted, held| {
            let svm = Svm::fit(&fitted.features, &fitted.labels, materials, settings)?;
            let decisions = svm.decisions(held);
            Ok(decisions.iter().map(|row| svm.vote(row)).collect())
        })?;
        let mut chosen = BTreeMap::new();
        if grid.len() > 1 {
            chosen.insert("c".into(), settings.c);
            chosen.insert("gamma_times_features".into(), settings.gamma * width as f64);
        }
        let folds = train.sweeps.inner_folds();
        progress(format!("calibrating on {folds} inner splits …"));
        let (mut decisions, mut labels) = (Vec::new(), Vec::new());
        for part in 0..folds {
            let [fitted, held] = train.sides(&train.inner(part)?);
            let svm = Svm::fit(&fitted.features, &fitted.labels, materials, settings)?;
            decisions.extend(svm.decisions(&held.features));
            labels.extend(held.labels);
        }
        let sigmoids = fit_platt(&decisions, &labels, materials)?;
        let (all, scaler) = train.all();
        let svm = Svm::fit(&all.features, &all.labels, materials, settings)?;
        Ok(Fit {
            classifier: Box::new(CalibratedSvm { svm, sigmoids }),
            scaler,
            chosen,
        })
    }

    fn load(&self, stored: &Stored<'_>) -> Result<Box<dyn FittedMethod>, PipelineError> {
        let (weights, materials) = (stored.weights, stored.materials);
        let pairs = materials * (materials - 1) / 2;
        let platt = stored.doubles("svm.platt", 2 * pairs)?;
        let counts = get_indices(weights, "svm.support_counts")?;
        of_length("svm.support_counts", counts.len(), pairs)?;
        let support = counts.iter().sum();
        let vectors = get(weights, "svm.features")?.values.len() / stored.width;
        let rows = get_indices_below(weights, "svm.support_rows", vectors)?;
        of_length("svm.support_rows", rows.len(), support)?;
        let duals = get_doubles(weights, "svm.support_weights")?;
        of_length("svm.support_weights", duals.len(), support)?;
        let rho = stored.doubles("svm.rho", pairs)?;
        let svm = Svm::from_parts(
            stored.features("svm.features")?,
            stored.number("svm.gamma")?,
            materials,
            &counts,
            &rows,
            &duals,
            &rho,
        );
        let sigmoids = platt.chunks_exact(2).map(|s| [s[0], s[1]]).collect();
        Ok(Box::new(CalibratedSvm {
            svm,
            sigmoids: PlattSigmoids(sigmoids),
        }))
    }
}

impl FittedMethod for CalibratedSvm {
    fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        let decisions = self.svm.decisions(features);
        self.svm.log_probabilities(&decisions, &self.sigmoids)
    }

    fn save(&self, weights: &mut Weights) {
        let Self { svm, sigmoids } = self;
        let pairs = || svm.pairs.iter();
        put(weights, "svm.features", svm.features.values().to_vec());
        put_doubles(weights, "svm.gamma", &[svm.gamma]);
        let counts: Vec<usize> = pairs().map(|pair| pair.rows.len()).collect();
        put_indices(weights, "svm.support_counts", &counts);
        let rows: Vec<usize> = pairs().flat_map(|p| p.rows.iter().copied()).collect();
        put_indices(weights, "svm.support_rows", &rows);
        let duals: Vec<f64> = pairs().flat_map(|p| p.weights.iter().copied()).collect();
        put_doubles(weights, "svm.support_weights", &duals);
        let rho: Vec<f64> = pairs().map(|pair| pair.rho).collect();
        put_doubles(weights, "svm.rho", &rho);
        put_doubles(weights, "svm.platt", sigmoids.0.as_flattened());
    }
}
