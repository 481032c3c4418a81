//! Masks of dead taxels: every kind of model predicts without them, and trained dropout of taxels pays.

use rand::RngExt;
use tactnet_data::twin;
use tactnet_data::{Dataset, Fold, Samples, Scheme, Seed, SweepView, shuffle};
use tactnet_models::Compute;

use crate::{
    Augmentation, Classifier, ClassifierConfig, Disturbance, ModelConfig, ModelRecipe,
    NetworkRecipe, OnlineClassifier, PredictionMethod, fit_baseline, train_network,
};

fn twin(sweeps: usize) -> Dataset {
    twin::small(6, sweeps, 120).unwrap()
}

fn baseline(fold: &Fold<'_>, name: &str) -> Classifier {
    let ModelRecipe::Baseline(recipe) = ModelRecipe::load(name).unwrap() else {
        panic!("{name} is a baseline");
    };
    let fit = fit_baseline(&recipe, &fold.train, Seed(1), |_| {}).unwrap();
    let config = ClassifierConfig::new(ModelConfig::Baseline(recipe), &fold.train, Seed(1));
    let device = Compute::Cpu.open().unwrap();
    Classifier::new(config, &fit.weights, &device).unwrap()
}

fn network(fold: &Fold<'_>, epochs: usize, augmentation: Augmentation) -> Classifier {
    let text = format!(
        "name = \"small\"\nnetwork = {{ maps = [8, 8], hidden = 32 }}\ninput = {{ scaling = \"per-taxel\" }}\n\
         [training]\nepochs = {epochs}\nbatch = 16\nlearning_rate = 0.005\nmethod = {{ kind = \"base\" }}\n"
    );
    let mut recipe = NetworkRecipe::parse("small", &text).unwrap();
    recipe.training.augmentation = augmentation;
    let device = Compute::Cpu.open().unwrap();
    let trained = train_network(&recipe, &fold.train, Seed(1), &device, |_| true);
    trained.unwrap().unwrap()
}

/// Returns the sweeps of `view`, changed by `change`.
fn changed(view: &SweepView<'_>, change: impl Fn(usize, &mut [f32])) -> Dataset {
    let (dataset, shape) = (view.dataset(), view.shape());
    let mut values = vec![0.0; view.len() * shape.values()];
    for (position, sweep) in values.chunks_exact_mut(shape.values()).enumerate() {
        view.copy_batch(&[position], sweep);
        change(position, sweep);
    }
    let records = view
        .indices()
        .iter()
        .map(|&at| dataset.records()[at].clone());
    let (rate, labels) = (dataset.sample_rate_hz(), dataset.labels().clone());
    let samples = Samples::F32(values);
    Dataset::new("changed", rate, shape, labels, records.collect(), samples).unwrap()
}

fn scores(classifier: &Classifier, dataset: &Dataset) -> Vec<Vec<f64>> {
    let view = SweepView::all(dataset);
    classifier
        .log_probabilities(&view, PredictionMethod::Plain)
        .unwrap()
}

#[test]
fn predictions_do_not_depend_on_masked_taxels_which_count_as_typical() {
    let dataset = twin(10);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
    let models = [
        network(&fold, 2, Augmentation::default()),
        baseline(&fold, "means"),
        baseline(&fold, "lda"),
        baseline(&fold, "minirocket"),
        baseline(&fold, "quant"),
    ];
    for (model, mut classifier) in models.into_iter().enumerate() {
        let clean = changed(&fold.test, |_, _| {});
        let before = scores(&classifier, &clean);
        classifier.mask(&[9, 3]).unwrap();
        let dead = classifier.dead().clone();
        assert_eq!(dead.0.keys().copied().collect::<Vec<_>>(), [3, 9]);
        let masked = scores(&classifier, &clean);
        assert_ne!(masked, before, "model {model}");
        let foreign = changed(&fold.test, |position, sweep| {
            let mut rng = Seed(7).rng(("foreign values", position));
            for frame in sweep.chunks_exact_mut(16) {
                for taxel in [3, 9] {
                    frame[taxel] = rng.random_range(-1e4..1e4);
                }
            }
        });
        assert_eq!(scores(&classifier, &foreign), masked, "model {model}");
        let values: Vec<f32> = (0..fold.train.len())
            .flat_map(|at| fold.train.sweep(at).into_iter().skip(3).step_by(16))
            .collect();
        let (typical, count) = (dead.0[&3], values.len());
        if model == 0 {
            let mean = values.iter().map(|v| f64::from(*v)).sum::<f64>() / count as f64;
            // Sums in another order.
            assert!((f64::from(typical) - mean).abs() < 1e-3, "model {model}");
        } else {
            let below = values.iter().filter(|value| **value < typical).count();
            let above = values.iter().filter(|value| **value > typical).count();
            assert!(2 * below <= count && 2 * above <= count, "model {model}");
        }
        classifier.mask(&[]).unwrap();
        assert_eq!(scores(&classifier, &clean), before, "model {model}");
        // Linear discriminants see the mean of the taxel's spectra, which no constant has.
        if model != 2 {
            let constant = changed(&fold.test, |_, sweep| {
                Disturbance::Dead(dead.clone()).apply(sweep, 16);
            });
            assert_eq!(scores(&classifier, &constant), masked, "model {model}");
        }
    }
}

#[test]
fn the_online_classifier_masks_the_same_taxels() {
    let dataset = twin(10);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
    let mut classifier = network(&fold, 2, Augmentation::default());
    classifier.mask(&[0, 15]).unwrap();
    let clean = changed(&fold.test, |_, _| {});
    let offline = scores(&classifier, &clean);
    let mut online = OnlineClassifier::new(&classifier, None, 0).unwrap();
    for (sweep, expected) in offline.iter().enumerate() {
        online.begin();
        for frame in clean.sweep(sweep).chunks_exact(16) {
            online.push(frame);
        }
        let found = online.classify().log_probability;
        for (found, expected) in found.iter().zip(expected) {
            // Another implementation of the same network.
            assert!((found.exp() - expected.exp()).abs() < 1e-4);
        }
    }
}

#[test]
fn masks_that_cannot_be_are_refused() {
    let dataset = twin(10);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
    let mut classifier = baseline(&fold, "lda");
    let mut refused = |dead: &[usize]| classifier.mask(dead).unwrap_err().to_string();
    assert!(refused(&[2, 16]).contains("0 to 15"));
    assert!(refused(&(0..16).collect::<Vec<_>>()).contains("all 16"));

    // A run of an earlier version does not name the means.
    let ModelRecipe::Baseline(recipe) = ModelRecipe::load("lda").unwrap() else {
        panic!("a baseline");
    };
    let mut weights = fit_baseline(&recipe, &fold.train, Seed(1), |_| {})
        .unwrap()
        .weights;
    weights.0.remove("taxels.median").unwrap();
    let config = ClassifierConfig::new(ModelConfig::Baseline(recipe), &fold.train, Seed(1));
    let device = Compute::Cpu.open().unwrap();
    let mut earlier = Classifier::new(config, &weights, &device).unwrap();
    let refused = earlier.mask(&[2]).unwrap_err().to_string();
    assert!(refused.contains("train it again"), "{refused}");
    earlier.mask(&[]).unwrap();
}

#[test]
fn a_network_trained_as_robust_is_better_with_dead_taxels_and_masks_help_both() {
    let dataset = twin(40);
    let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
    let accuracy = |classifier: &mut Classifier, masked: bool| {
        let mut right = 0.0;
        for draw in 0..8 {
            let mut taxels: Vec<usize> = (0..16).collect();
            shuffle(&mut taxels, &mut Seed(3).rng(("dead taxels", draw)));
            let dead = &taxels[..2];
            let test = changed(&fold.test, |_, sweep| {
                for frame in sweep.chunks_exact_mut(16) {
                    dead.iter().for_each(|&taxel| frame[taxel] = 0.0);
                }
            });
            classifier.mask(if masked { dead } else { &[] }).unwrap();
            let view = SweepView::all(&test);
            let found = classifier.predict(&view, PredictionMethod::Plain).unwrap();
            right += found.accuracy() / 8.0;
        }
        classifier.mask(&[]).unwrap();
        right
    };
    let measured = |augmentation: Augmentation| {
        let mut classifier = network(&fold, 60, augmentation);
        let plain = classifier
            .predict(&fold.test, PredictionMethod::Plain)
            .unwrap();
        let [unknown, masked] = [false, true].map(|masked| accuracy(&mut classifier, masked));
        [plain.accuracy(), unknown, masked]
    };
    let robust = NetworkRecipe::load("robust").unwrap().training.augmentation;
    let (plain, robust) = (measured(Augmentation::default()), measured(robust));
    let text = format!("clean, dead, masked: {plain:?} trained plainly, {robust:?} as `robust`");
    // Two taxels dead. A share of 8 times 48 sweeps has a standard error of 2.5 points.
    assert!(robust[1] > plain[1] + 0.05, "{text}");
    assert!(plain[2] > plain[1] + 0.05, "{text}");
    assert!(robust[2] > robust[1], "{text}");
}
