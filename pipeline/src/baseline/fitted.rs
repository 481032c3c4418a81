//! Fitted baselines: features, scaling, classifier, one after the other.

use tactnet_data::SweepView;
use tactnet_models::{Knn, Lda, PlattSigmoids, Ridge, Svm, SvmSettings, Weights, log_softmax};

use crate::features::arrays::{
    get, get_doubles, get_indices, get_indices_below, of_length, put, put_doubles, put_indices,
};
use crate::features::extractor::Extractor;
use crate::features::scaler::Scaler;
use crate::{BaselineRecipe, ClassicalClassifier, ClassifierConfig, FeatureScaling, PipelineError};

/// A fitted classifier on features.
pub(crate) enum FittedClassifier {
    Knn(Knn),
    Svm(Svm, PlattSigmoids),
    Lda(Lda),
    /// With the inverse temperature of its scores.
    Ridge(Ridge, f64),
}

/// A fitted baseline.
pub(crate) struct Baseline {
    pub extractor: Extractor,
    pub scaler: Option<Scaler>,
    pub classifier: FittedClassifier,
}

impl Baseline {
    /// Log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(&self, view: &SweepView<'_>) -> Vec<Vec<f64>> {
        let mut features = self.extractor.features(view);
        if let Some(scaler) = &self.scaler {
            scaler.apply(&mut features);
        }
        match &self.classifier {
            FittedClassifier::Knn(knn) => knn.log_probabilities(&features),
            FittedClassifier::Svm(svm, sigmoids) => {
                svm.log_probabilities(&svm.decisions(&features), sigmoids)
            }
            FittedClassifier::Lda(lda) => lda.log_probabilities(&features),
            FittedClassifier::Ridge(ridge, inverse_temperature) => ridge
                .scores(&features)
                .iter()
                .map(|row| {
                    let scores: Vec<f32> = row
                        .iter()
                        .map(|s| (s * inverse_temperature) as f32)
                        .collect();
                    log_softmax(&scores)
                })
                .collect(),
        }
    }

    /// All fitted numbers, by name.
    pub fn to_weights(&self) -> Weights {
        let mut weights = Weights::default();
        let w = &mut weights;
        self.extractor.save(w);
        if let Some(scaler) = &self.scaler {
            scaler.save(w);
        }
        match &self.classifier {
            FittedClassifier::Knn(knn) => {
                put(w, "knn.features", knn.features.values().to_vec());
                put_indices(w, "knn.labels", &knn.labels);
                put_indices(w, "knn.neighbours", &[knn.neighbours]);
            }
            FittedClassifier::Svm(svm, sigmoids) => {
                put(w, "svm.features", svm.features.values().to_vec());
                put_doubles(w, "svm.gamma", &[svm.gamma]);
                let counts: Vec<usize> = svm.pairs.iter().map(|pair| pair.rows.len()).collect();
                let pairs = || svm.pairs.iter();
                put_indices(w, "svm.support_counts", &counts);
                let rows: Vec<usize> = pairs().flat_map(|p| p.rows.iter().copied()).collect();
                put_indices(w, "svm.support_rows", &rows);
                let duals: Vec<f64> = pairs().flat_map(|p| p.weights.iter().copied()).collect();
                put_doubles(w, "svm.support_weights", &duals);
                let rho: Vec<f64> = pairs().map(|pair| pair.rho).collect();
                put_doubles(w, "svm.rho", &rho);
                put_doubles(w, "svm.platt", sigmoids.0.as_flattened());
            }
            FittedClassifier::Lda(lda) => {
                put_doubles(w, "lda.coefficients", &lda.coefficients);
                put_doubles(w, "lda.intercepts", &lda.intercepts);
            }
            FittedClassifier::Ridge(ridge, inverse_temperature) => {
                put(w, "ridge.coefficients", ridge.coefficients.clone());
                put_doubles(w, "ridge.intercepts", &ridge.intercepts);
                put_doubles(w, "ridge.penalty", &[ridge.penalty]);
                put_doubles(w, "ridge.inverse_temperature", &[*inverse_temperature]);
            }
        }
        weights
    }

    /// Rebuilds what [`Baseline::to_weights`] gave.
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
        let (width, materials) = (extractor.width(), config.labels.len());
        let features = |name: &str| {
            let values = get(weights, name)?.values.clone();
            of_length(name, values.len(), values.len().next_multiple_of(width))?;
            Ok::<_, PipelineError>(tactnet_models::Features::new(width, values))
        };
        let one = |name: &str| {
            let values = get_doubles(weights, name)?;
            of_length(name, values.len(), 1)?;
            Ok::<_, PipelineError>(values[0])
        };
        let classifier = match recipe.classifier {
            ClassicalClassifier::Knn { .. } => {
                let features = features("knn.features")?;
                let labels = get_indices_below(weights, "knn.labels", materials)?;
                of_length("knn.labels", labels.len(), features.len())?;
                let neighbours = get_indices_below(weights, "knn.neighbours", labels.len() + 1)?;
                of_length("knn.neighbours", neighbours.len(), 1)?;
                FittedClassifier::Knn(Knn {
                    features,
                    labels,
                    materials,
                    neighbours: neighbours[0].max(1),
                })
            }
            ClassicalClassifier::Svm { .. } => {
                let pairs = materials * (materials - 1) / 2;
                let platt = get_doubles(weights, "svm.platt")?;
                of_length("svm.platt", platt.len(), 2 * pairs)?;
                let counts = get_indices(weights, "svm.support_counts")?;
                of_length("svm.support_counts", counts.len(), pairs)?;
                let support = counts.iter().sum();
                let vectors = get(weights, "svm.features")?.values.len() / width;
                let rows = get_indices_below(weights, "svm.support_rows", vectors)?;
                of_length("svm.support_rows", rows.len(), support)?;
                let duals = get_doubles(weights, "svm.support_weights")?;
                of_length("svm.support_weights", duals.len(), support)?;
                let rho = get_doubles(weights, "svm.rho")?;
                of_length("svm.rho", rho.len(), pairs)?;
                let svm = Svm::from_parts(
                    features("svm.features")?,
                    one("svm.gamma")?,
                    materials,
                    &counts,
                    &rows,
                    &duals,
                    &rho,
                );
                let sigmoids = platt.chunks_exact(2).map(|s| [s[0], s[1]]).collect();
                FittedClassifier::Svm(svm, PlattSigmoids(sigmoids))
            }
            ClassicalClassifier::Lda => {
                let lda = Lda {
                    coefficients: get_doubles(weights, "lda.coefficients")?,
                    intercepts: get_doubles(weights, "lda.intercepts")?,
                };
                of_length(
                    "lda.coefficients",
                    lda.coefficients.len(),
                    width * materials,
                )?;
                of_length("lda.intercepts", lda.intercepts.len(), materials)?;
                FittedClassifier::Lda(lda)
            }
            ClassicalClassifier::Ridge { .. } => {
                let ridge = Ridge {
                    coefficients: get(weights, "ridge.coefficients")?.values.clone(),
                    intercepts: get_doubles(weights, "ridge.intercepts")?,
                    penalty: one("ridge.penalty")?,
                };
                of_length(
                    "ridge.coefficients",
                    ridge.coefficients.len(),
                    width * materials,
                )?;
                of_length("ridge.intercepts", ridge.intercepts.len(), materials)?;
                FittedClassifier::Ridge(ridge, one("ridge.inverse_temperature")?)
            }
        };
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

/// All settings of a support vector machine that can be chosen.
pub(crate) fn svm_grid(c: &[f64], gamma: &[f64], width: usize) -> Vec<SvmSettings> {
    c.iter()
        .flat_map(|&c| {
            gamma.iter().map(move |gamma| SvmSettings {
                c,
                gamma: gamma / width as f64,
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use tactnet_data::twin::{TwinConfig, generate};
    use tactnet_data::{Fold, Scheme, Seed};
    use tactnet_models::{Compute, Weights};

    use crate::{
        Classifier, ClassifierConfig, ModelConfig, ModelRecipe, PredictionMethod, fit_baseline,
    };

    /// A number of a weights file that is changed makes another classifier or an error, never a panic or a huge allocation.
    #[test]
    fn changed_weights_are_an_error_or_another_classifier() {
        let twin = generate(&TwinConfig {
            materials: 3,
            sweeps: 10,
            steps: 120,
            ..TwinConfig::default()
        })
        .unwrap();
        let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let mut refused = 0;
        for name in ["minirocket", "multirocket-hydra", "svm-h", "knn-l", "lda"] {
            let ModelRecipe::Baseline(recipe) = ModelRecipe::load(name).unwrap() else {
                panic!("{name} is a baseline");
            };
            let fitted = fit_baseline(&recipe, &fold.train, Seed(1), |_| {}).unwrap();
            let model = ModelConfig::Baseline(recipe);
            let config = ClassifierConfig::new(model, &fold.train, Seed(1));
            let attempt = |weights: &Weights| {
                let classifier = Classifier::new(config.clone(), weights, &device)?;
                classifier.predict(&fold.test, PredictionMethod::Plain)
            };
            attempt(&fitted.weights).unwrap();
            let mut rng = Seed(1).rng(("changed weights", name.len()));
            for (tensor, at) in fitted.weights.0.iter().flat_map(|(name, tensor)| {
                let last = tensor.values.len().saturating_sub(1);
                [0, last / 2, last].map(|at| (name, at))
            }) {
                let odd = [-1.0, 0.5, 1e9, f32::MAX, f32::NAN, 7.0];
                let mut changed = fitted.weights.clone();
                let values = &mut changed.0.get_mut(tensor).unwrap().values;
                if let Some(value) = values.get_mut(at) {
                    *value = odd[rng.random_range(0..odd.len())];
                }
                refused += usize::from(attempt(&changed).is_err());
                changed.0.get_mut(tensor).unwrap().values.truncate(at);
                refused += usize::from(attempt(&changed).is_err());
            }
        }
        assert!(refused > 20, "{refused} of the changes were refused");
    }
}
