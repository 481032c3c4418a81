use rand::RngExt;
use tactnet_data::twin::{self, TwinConfig, generate};
use tactnet_data::{Dataset, Fold, Scheme, Seed};
use tactnet_models::{Compute, Weights};

use super::knn::KnnRecipe;
use super::ridge::RidgeRecipe;
use super::svm::SvmRecipe;
use crate::features::arrays::get_doubles;
use crate::{
    BaselineFit, BaselineRecipe, ClassicalClassifier, Classifier, ClassifierConfig, FeatureScaling,
    FeatureSet, MeanRemoval, ModelConfig, ModelRecipe, PredictionMethod, fit_baseline,
};

/// Returns sweeps with permuted labels, so that nothing learnt from them generalises.
fn meaningless() -> Dataset {
    twin::small(3, 20, 200)
        .unwrap()
        .permute_labels(Seed(5))
        .unwrap()
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

/// With a tiny penalty, 48 sweeps of 1000 features are fitted exactly; only held-out sweeps reveal the overfitting.
#[test]
fn an_overfitted_ridge_classifier_is_not_confident() {
    let fit = fit(ClassicalClassifier::Ridge(RidgeRecipe {
        penalties: vec![1e-3],
    }));
    assert!(fit.chosen["temperature"] > 1.0, "{:?}", fit.chosen);
}

#[test]
fn an_overfitted_support_vector_machine_is_not_confident() {
    let fit = fit(ClassicalClassifier::Svm(SvmRecipe {
        c: vec![100.0],
        gamma: vec![1.0],
    }));
    // Slopes and offsets alternate.
    let platt = get_doubles(&fit.weights, "svm.platt").unwrap();
    let slopes = platt.chunks_exact(2).map(|sigmoid| sigmoid[0].abs());
    let steepest = slopes.fold(0.0, f64::max);
    // All decisions on the fitted sweeps are correct with a margin of at least one.
    assert!(steepest < 1.5, "{platt:?}");
}

/// A sweep is its own nearest neighbour, so one neighbour is always correct on the fitted sweeps.
#[test]
fn neighbours_are_selected_on_held_out_sweeps() {
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
            classifier: ClassicalClassifier::Knn(KnnRecipe {
                neighbours: vec![1, 9],
            }),
        };
        fit_baseline(&recipe, &fold.train, Seed(1), |_| {})
            .unwrap()
            .chosen["neighbours"]
    };
    let chosen: Vec<f64> = (1..=4).map(right).collect();
    assert!(chosen.contains(&9.0), "{chosen:?}");
}

/// A changed number in a weights file gives another classifier or an error, never a panic or a huge allocation.
#[test]
fn changed_weights_are_an_error_or_another_classifier() {
    let twin = twin::small(3, 10, 120).unwrap();
    let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
    let device = Compute::Cpu.open().unwrap();
    let mut refused = 0;
    let names = [
        "minirocket",
        "multirocket-hydra",
        "svm-h",
        "knn-l",
        "lda",
        "quant",
    ];
    for name in names {
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
