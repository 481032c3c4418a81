//! Fitting a baseline to training sweeps.

use std::collections::BTreeMap;

use tactnet_data::{Seed, TrainSplit};
use tactnet_models::{
    Features, Gram, Knn, Lda, Ridge, Svm, Weights, argmax, fit_inverse_temperature, fit_platt,
};

use crate::baseline::fitted::{Baseline, FittedClassifier, svm_grid};
use crate::features::extractor::Extractor;
use crate::features::scaler::Scaler;
use crate::{BaselineRecipe, ClassicalClassifier, FeatureScaling, PipelineError};

/// What fitting a baseline gave.
#[derive(Debug, Clone)]
pub struct BaselineFit {
    /// All fitted numbers, by name; `Classifier::new` reads them.
    pub weights: Weights,
    /// Settings chosen on the inner split or by leave-one-out, by name.
    pub chosen: BTreeMap<String, f64>,
}

/// Training sweeps of a fold with their features.
struct Train {
    features: Features,
    labels: Vec<usize>,
    materials: usize,
    /// Features at the end that have Hydra's own scaling.
    sparse: usize,
    scaling: FeatureScaling,
}

impl Train {
    /// Features of the sweeps at `fit`, scaled by themselves, and of those at `held`, scaled likewise.
    fn part(&self, fit: &[usize], held: &[usize]) -> (Features, Features, Option<Scaler>) {
        let (mut fitted, mut other) = (self.features.select(fit), self.features.select(held));
        let scaler = match self.scaling {
            FeatureScaling::Raw => None,
            FeatureScaling::Standard => Some(Scaler::fit(&fitted, self.sparse)),
        };
        if let Some(scaler) = &scaler {
            scaler.apply(&mut fitted);
            scaler.apply(&mut other);
        }
        (fitted, other, scaler)
    }

    fn labels_of(&self, positions: &[usize]) -> Vec<usize> {
        positions
            .iter()
            .map(|&position| self.labels[position])
            .collect()
    }
}

/// Positions among the training sweeps: to fit to, to choose by.
struct Inner {
    fit: Vec<usize>,
    held: Vec<usize>,
}

fn inner(train: &TrainSplit<'_>, part: usize) -> Result<Inner, PipelineError> {
    let (fit, held) = train.inner(part)?;
    let all = train.indices();
    let place = |indices: &[usize]| -> Vec<usize> {
        let found = indices
            .iter()
            .filter_map(|index| all.binary_search(index).ok());
        found.collect()
    };
    Ok(Inner {
        fit: place(fit.indices()),
        held: place(held.indices()),
    })
}

/// Fits `recipe` to training sweeps.
///
/// Settings are chosen and probabilities calibrated on inner splits of the training sweeps; test sweeps are never read. A support vector
/// machine's settings are chosen by the votes of its pairs; random kernels' biases and the scaling of their features come from all
/// training sweeps, those that calibrate included.
/// `say` is told what goes on, a line at a time.
///
/// # Errors
/// Sweeps too short for the features, too few sweeps for the inner split, a solver that fails.
pub fn fit_baseline(
    recipe: &BaselineRecipe,
    sweeps: &TrainSplit<'_>,
    seed: Seed,
    mut say: impl FnMut(String),
) -> Result<BaselineFit, PipelineError> {
    say(format!("features of {} training sweeps …", sweeps.len()));
    let extractor = Extractor::fit(recipe.features, recipe.levels, sweeps, seed)?;
    let train = Train {
        features: extractor.features(sweeps),
        labels: sweeps.labels().collect(),
        materials: sweeps.dataset().labels().len(),
        sparse: extractor.hydra_width(),
        scaling: recipe.scaling,
    };
    let width = extractor.width();
    let everything: Vec<usize> = (0..train.labels.len()).collect();
    let mut chosen = BTreeMap::new();
    let (classifier, scaler) = match &recipe.classifier {
        ClassicalClassifier::Knn { neighbours } => {
            let k = choose(neighbours, sweeps, &train, &mut say, |&k, fit, held| {
                let scores = knn(fit.0, fit.1, train.materials, k).log_probabilities(held);
                Ok(scores.iter().map(|row| argmax(row)).collect())
            })?;
            if neighbours.len() > 1 {
                chosen.insert("neighbours".into(), k as f64);
            }
            let (features, _, scaler) = train.part(&everything, &[]);
            (
                FittedClassifier::Knn(knn(features, train.labels, train.materials, k)),
                scaler,
            )
        }
        ClassicalClassifier::Svm { c, gamma } => {
            let grid = svm_grid(c, gamma, width);
            let settings = choose(&grid, sweeps, &train, &mut say, |&settings, fit, held| {
                let svm = Svm::fit(&fit.0, &fit.1, train.materials, settings)?;
                let decisions = svm.decisions(held);
                Ok(decisions.iter().map(|row| svm.vote(row)).collect())
            })?;
            if grid.len() > 1 {
                chosen.insert("c".into(), settings.c);
                chosen.insert("gamma_times_features".into(), settings.gamma * width as f64);
            }
            let folds = sweeps.inner_folds();
            say(format!("calibrating on {folds} inner splits …"));
            let (mut decisions, mut labels) = (Vec::new(), Vec::new());
            for part in 0..folds {
                let Inner { fit, held } = inner(sweeps, part)?;
                let (fitted, other, _) = train.part(&fit, &held);
                let svm = Svm::fit(&fitted, &train.labels_of(&fit), train.materials, settings)?;
                decisions.extend(svm.decisions(&other));
                labels.extend(train.labels_of(&held));
            }
            let sigmoids = fit_platt(&decisions, &labels, train.materials)?;
            let (features, _, scaler) = train.part(&everything, &[]);
            let svm = Svm::fit(&features, &train.labels, train.materials, settings)?;
            (FittedClassifier::Svm(svm, sigmoids), scaler)
        }
        ClassicalClassifier::Lda => {
            let (features, _, scaler) = train.part(&everything, &[]);
            let lda = Lda::fit(&features, &train.labels, train.materials)?;
            (FittedClassifier::Lda(lda), scaler)
        }
        ClassicalClassifier::Ridge { penalties } => {
            let Train {
                mut features,
                labels,
                materials,
                sparse,
                scaling,
            } = train;
            let scaler =
                (scaling == FeatureScaling::Standard).then(|| Scaler::fit(&features, sparse));
            if let Some(scaler) = &scaler {
                scaler.apply(&mut features);
            }
            say(format!("scalar products of {width} features …"));
            let gram = Gram::of(&features);
            say("calibrating on an inner split …".into());
            let Inner { fit, held } = inner(sweeps, 0)?;
            let scores = gram.held_out_scores(&fit, &held, &labels, materials, penalties)?;
            let truth: Vec<usize> = held.iter().map(|&position| labels[position]).collect();
            let inverse = fit_inverse_temperature(&scores, &truth);
            say("fitting …".into());
            let ridge = Ridge::fit(&features, gram, &labels, materials, penalties)?;
            chosen.insert("penalty".into(), ridge.penalty);
            chosen.insert("temperature".into(), 1.0 / inverse);
            (FittedClassifier::Ridge(ridge, inverse), scaler)
        }
    };
    let baseline = Baseline {
        extractor,
        scaler,
        classifier,
    };
    Ok(BaselineFit {
        weights: baseline.to_weights(),
        chosen,
    })
}

fn knn(features: Features, labels: Vec<usize>, materials: usize, neighbours: usize) -> Knn {
    Knn {
        features,
        labels,
        materials,
        neighbours,
    }
}

/// The candidate whose predictions are right most often on the validation side of the first inner split; the first
/// among equals. A single candidate is not tried.
fn choose<T: Copy + std::fmt::Debug>(
    candidates: &[T],
    sweeps: &TrainSplit<'_>,
    train: &Train,
    say: &mut impl FnMut(String),
    predict: impl Fn(&T, (Features, Vec<usize>), &Features) -> Result<Vec<usize>, PipelineError>,
) -> Result<T, PipelineError> {
    if let [only] = candidates {
        return Ok(*only);
    }
    let Inner { fit, held } = inner(sweeps, 0)?;
    let (fitted, other, _) = train.part(&fit, &held);
    let truth = train.labels_of(&held);
    let mut best: Option<(usize, T)> = None;
    for (number, candidate) in candidates.iter().enumerate() {
        let found = predict(candidate, (fitted.clone(), train.labels_of(&fit)), &other)?;
        let right = found.iter().zip(&truth).filter(|(a, b)| a == b).count();
        say(format!(
            "inner split, setting {}/{}: {:.1} %",
            number + 1,
            candidates.len(),
            100.0 * right as f64 / truth.len() as f64
        ));
        if best.as_ref().is_none_or(|(most, _)| right > *most) {
            best = Some((right, *candidate));
        }
    }
    best.map(|(_, candidate)| candidate)
        .ok_or(PipelineError::Recipe {
            origin: "of a baseline".into(),
            reason: "no setting to choose from".into(),
        })
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin::{TwinConfig, generate};
    use tactnet_data::{Dataset, Fold, Scheme};

    use super::*;
    use crate::features::arrays::get_doubles;
    use crate::{FeatureSet, MeanRemoval};

    /// Sweeps whose labels say nothing: what is learnt of them holds for no other sweep.
    fn meaningless() -> Dataset {
        let config = TwinConfig {
            materials: 3,
            sweeps: 20,
            steps: 200,
            ..TwinConfig::default()
        };
        generate(&config).unwrap().permute_labels(Seed(5)).unwrap()
    }

    fn fit(classifier: ClassicalClassifier) -> BaselineFit {
        let dataset = meaningless();
        let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
        let recipe = BaselineRecipe {
            name: "test".into(),
            features: FeatureSet::LogSpectra,
            levels: MeanRemoval::None,
            scaling: FeatureScaling::Standard,
            classifier,
        };
        fit_baseline(&recipe, &fold.train, Seed(1), |_| {}).unwrap()
    }

    /// With next to no penalty, 48 sweeps of 1000 features are learnt by heart: only sweeps that were held out show that nothing is known.
    #[test]
    fn a_ridge_classifier_that_learns_by_heart_is_not_sure_of_itself() {
        let fit = fit(ClassicalClassifier::Ridge {
            penalties: vec![1e-3],
        });
        assert!(fit.chosen["temperature"] > 1.0, "{:?}", fit.chosen);
    }

    #[test]
    fn a_support_vector_machine_that_learns_by_heart_is_not_sure_of_itself() {
        let fit = fit(ClassicalClassifier::Svm {
            c: vec![100.0],
            gamma: vec![1.0],
        });
        // Pairs of slope and offset.
        let platt = get_doubles(&fit.weights, "svm.platt").unwrap();
        let slopes = platt.chunks_exact(2).map(|sigmoid| sigmoid[0].abs());
        let steepest = slopes.fold(0.0, f64::max);
        // On the sweeps that it was fitted to all decisions are right, by one at least.
        assert!(steepest < 1.5, "{platt:?}");
    }

    /// A sweep is its own nearest neighbour, so that one neighbour is never wrong among the sweeps that were fitted to.
    #[test]
    fn neighbours_are_not_chosen_among_the_sweeps_that_were_fitted_to() {
        let right = |seed: u64| {
            let dataset = generate(&TwinConfig {
                materials: 4,
                sweeps: 25,
                steps: 200,
                seed,
                ..TwinConfig::default()
            })
            .unwrap();
            let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
            let recipe = BaselineRecipe {
                name: "test".into(),
                features: FeatureSet::LogSpectra,
                levels: MeanRemoval::None,
                scaling: FeatureScaling::Standard,
                classifier: ClassicalClassifier::Knn {
                    neighbours: vec![1, 9],
                },
            };
            fit_baseline(&recipe, &fold.train, Seed(1), |_| {})
                .unwrap()
                .chosen["neighbours"]
        };
        let chosen: Vec<f64> = (1..=4).map(right).collect();
        assert!(chosen.contains(&9.0), "{chosen:?}");
    }
}
