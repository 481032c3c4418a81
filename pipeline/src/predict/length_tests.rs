//! Sweeps of unequal length: every kind of model learns and predicts them, and nothing but their frames decides.

use rand::RngExt;
use tactnet_data::twin;
use tactnet_data::{Dataset, Fold, Samples, Scheme, Seed, SweepRecord, SweepView, TrainSplit};
use tactnet_models::{Compute, log_mean_exp_into};

use crate::{
    Calibration, CalibrationTarget, Classifier, ClassifierConfig, LengthAccuracy, MeanRemoval,
    ModelConfig, ModelRecipe, NetworkRecipe, NoveltyScore, OnlineClassifier, PipelineError,
    PredictionMethod, evaluate_all_ways, fit_baseline, train_network,
};

const STEPS: usize = 360;

fn twin() -> Dataset {
    twin::small(4, 30, STEPS).unwrap()
}

/// Returns lengths from half of the longest sweep on, at random.
fn random_lengths(sweeps: usize) -> Vec<usize> {
    let mut rng = Seed(5).rng("lengths");
    let mut lengths: Vec<usize> = (0..sweeps)
        .map(|_| rng.random_range(STEPS / 2..=STEPS))
        .collect();
    lengths[0] = STEPS;
    lengths
}

fn unequal() -> Dataset {
    let twin = twin();
    let lengths = random_lengths(twin.len());
    twin.with_lengths(lengths).unwrap()
}

fn fold(dataset: &Dataset) -> Fold<'_> {
    Fold::new(dataset, Scheme::default(), Seed(1), 0, 0).unwrap()
}

fn baseline(train: &TrainSplit<'_>, name: &str) -> Result<Classifier, PipelineError> {
    let ModelRecipe::Baseline(recipe) = ModelRecipe::load(name).unwrap() else {
        panic!("{name} is a baseline");
    };
    let fit = fit_baseline(&recipe, train, Seed(1), |_| {})?;
    let config = ClassifierConfig::new(ModelConfig::Baseline(recipe), train, Seed(1));
    Classifier::new(config, &fit.weights, &Compute::Cpu.open().unwrap())
}

/// Small networks: three pooled steps in front of the dense layer of the first one.
const NETWORKS: [&str; 2] = [
    "{ maps = [8, 16], pools = [12, 10], hidden = 32 }",
    "{ spectra = { taxel_units = 16, units = 32 }, hidden = 32 }",
];

fn network(train: &TrainSplit<'_>, layers: &str, epochs: usize) -> Classifier {
    let text = format!(
        "name = \"small\"\nnetwork = {layers}\ninput = {{ scaling = \"per-taxel\" }}\n\
         [training]\nepochs = {epochs}\nbatch = 12\nlearning_rate = 0.005\nmethod = {{ kind = \"base\" }}\n"
    );
    let recipe = NetworkRecipe::parse("small", &text).unwrap();
    let device = Compute::Cpu.open().unwrap();
    let trained = train_network(&recipe, train, Seed(1), &device, |_| true);
    trained.unwrap().unwrap()
}

fn scores(classifier: &Classifier, view: &SweepView<'_>) -> Vec<Vec<f64>> {
    classifier
        .log_probabilities(view, PredictionMethod::Plain)
        .unwrap()
}

fn accuracy(classifier: &Classifier, view: &SweepView<'_>) -> f64 {
    let predictions = classifier.predict(view, PredictionMethod::Plain).unwrap();
    predictions.accuracy()
}

#[test]
fn sweeps_that_end_at_random_are_learnt_about_as_well_as_whole_ones() {
    let (whole, unequal) = (twin(), unequal());
    let (of_whole, of_unequal) = (fold(&whole), fold(&unequal));
    // Sweeps that are a quarter shorter on average cost a few of 24 test sweeps; the standard error of the difference is 10 points. Guessing is
    // right in 25 %; the weakest features recognise half of the whole sweeps.
    let check = |name: &str, [whole, unequal]: [f64; 2]| {
        assert!(
            unequal > whole - 0.2 && unequal > 0.33,
            "{name}: {unequal}, whole {whole}"
        );
    };
    for layers in NETWORKS {
        let of = |fold: &Fold<'_>| accuracy(&network(&fold.train, layers, 12), &fold.test);
        check(layers, [of(&of_whole), of(&of_unequal)]);
    }
    for name in ["means", "svm-l", "svm-h", "lda", "minirocket", "quant"] {
        let of = |fold: &Fold<'_>| accuracy(&baseline(&fold.train, name).unwrap(), &fold.test);
        check(name, [of(&of_whole), of(&of_unequal)]);
    }
}

/// Returns the sweeps of a data set in reversed order, padded with other values.
fn reversed(dataset: &Dataset) -> Dataset {
    let (shape, taxels) = (dataset.shape(), dataset.shape().taxels());
    let order = || (0..dataset.len()).rev();
    let mut values: Vec<f32> = Vec::new();
    for index in order() {
        values.extend(dataset.sweep(index));
        let missing = shape.steps - dataset.steps_of(index);
        values.extend((0..missing * taxels).map(|at| (at % 251) as f32));
    }
    let records = order().map(|index| SweepRecord {
        sweep: index,
        ..dataset.records()[index].clone()
    });
    let lengths = order().map(|index| dataset.steps_of(index));
    let (rate, labels) = (dataset.sample_rate_hz(), dataset.labels().clone());
    let samples = Samples::F32(values);
    Dataset::new("reversed", rate, shape, labels, records.collect(), samples)
        .and_then(|reversed| reversed.with_lengths(lengths.collect()))
        .unwrap()
}

#[test]
fn neither_padding_nor_other_sweeps_decide_a_prediction() {
    let unequal = unequal();
    let other = reversed(&unequal);
    let train = TrainSplit::all(&unequal, Seed(1));
    let mut models: Vec<Classifier> = NETWORKS.map(|layers| network(&train, layers, 1)).into();
    models.extend(["lda", "svm-h"].map(|name| baseline(&train, name).unwrap()));
    for (model, classifier) in models.iter().enumerate() {
        let found = scores(classifier, &SweepView::all(&unequal));
        let mut again = scores(classifier, &SweepView::all(&other));
        again.reverse();
        assert_eq!(found, again, "model {model}");
        let alone = scores(classifier, &SweepView::new(&unequal, vec![17]));
        for (alone, found) in alone[0].iter().zip(&found[17]) {
            // The head adds the features of a single sweep in another order.
            assert!(
                (alone - found).abs() < 1e-5,
                "model {model}: {alone} {found}"
            );
        }
    }
}

/// Returns a data set of the sweeps of at most 240 steps, and the index of a sweep of [`STEPS`].
fn short_and_long(unequal: &Dataset) -> (Dataset, usize) {
    let short: Vec<usize> = (0..unequal.len())
        .filter(|index| unequal.steps_of(*index) <= 240)
        .collect();
    let long = (0..unequal.len()).find(|index| unequal.steps_of(*index) == STEPS);
    let materials = [0, 1, 2, 3].map(|label| {
        short
            .iter()
            .filter(|index| unequal.records()[**index].label == label)
            .count()
    });
    assert!(materials.iter().all(|sweeps| *sweeps > 2), "{materials:?}");
    (part(unequal, &short), long.unwrap())
}

#[test]
fn a_sweep_longer_than_all_training_sweeps_is_the_mean_over_windows() {
    let unequal = unequal();
    let (part, long) = short_and_long(&unequal);
    let train = TrainSplit::all(&part, Seed(1));
    let view = SweepView::new(&unequal, vec![long]);
    let window = train.longest();
    assert!(window <= 240);
    let mut models: Vec<Classifier> = NETWORKS.map(|layers| network(&train, layers, 1)).into();
    models.push(baseline(&train, "svm-l").unwrap());
    for (model, classifier) in models.iter().enumerate() {
        let found = &scores(classifier, &view)[0];
        let starts = [0, window / 2, STEPS - window];
        assert!(STEPS - window > window / 2 && STEPS - window <= window);
        let windows = starts.map(|start| scores(classifier, &view.window(start, window)));
        let mut expected = vec![0.0; found.len()];
        log_mean_exp_into(&windows.concat().concat(), &mut expected);
        assert_eq!(found, &expected, "model {model}");
    }
    // Embeddings are averaged likewise.
    let embedded = models[0].embed(&view).unwrap();
    let parts = [0, window / 2, STEPS - window]
        .map(|start| models[0].embed(&view.window(start, window)).unwrap());
    let mean = parts.iter().map(|part| part.hidden.row(0)[3]).sum::<f32>() / 3.0;
    // The sum of three rounded quotients.
    assert!((embedded.hidden.row(0)[3] - mean).abs() < 1e-5 * mean.abs().max(1.0));
}

/// Returns a data set of some sweeps.
fn part(dataset: &Dataset, indices: &[usize]) -> Dataset {
    let view = SweepView::new(dataset, indices.to_vec());
    let mut values = vec![0.0; view.len() * view.shape().values()];
    let positions: Vec<usize> = (0..view.len()).collect();
    view.copy_batch(&positions, &mut values);
    let records = indices
        .iter()
        .map(|index| dataset.records()[*index].clone());
    let (rate, labels) = (dataset.sample_rate_hz(), dataset.labels().clone());
    Dataset::new(
        "part",
        rate,
        view.shape(),
        labels,
        records.collect(),
        Samples::F32(values),
    )
    .and_then(|part| part.with_lengths(view.lengths().collect()))
    .unwrap()
}

#[test]
fn a_sweep_that_ends_early_has_the_same_prediction_online() {
    let unequal = unequal();
    let train = TrainSplit::all(&unequal, Seed(1));
    let view = SweepView::all(&unequal);
    for layers in NETWORKS {
        let classifier = network(&train, layers, 2);
        let offline = scores(&classifier, &view);
        let mut online = OnlineClassifier::new(&classifier, None, 0).unwrap();
        for (position, expected) in offline.iter().enumerate().step_by(7) {
            online.begin();
            for frame in view.sweep(position).chunks_exact(16) {
                online.push(frame);
            }
            assert_eq!(online.frames(), view.steps(position));
            let belief = online.classify();
            for (found, expected) in belief.log_probability.iter().zip(expected) {
                // The bound of all online predictions.
                assert!(
                    (found.exp() - expected.exp()).abs() < 1e-4,
                    "{layers}: {found} {expected}"
                );
            }
        }
    }
}

#[test]
fn a_sweep_longer_than_all_training_sweeps_has_the_same_prediction_online() {
    let unequal = unequal();
    let (part, long) = short_and_long(&unequal);
    let train = TrainSplit::all(&part, Seed(1));
    let (window, masks) = (train.longest(), 3);
    let calibration = Calibration {
        schema_version: Calibration::SCHEMA_VERSION,
        target: CalibrationTarget::default(),
        score: NoveltyScore::Energy,
        threshold: 0.0,
        object_thresholds: vec![],
        least_probability: 0.0,
        sweeps: 1,
    };
    for layers in NETWORKS {
        let classifier = network(&train, layers, 2);
        let mut online = OnlineClassifier::new(&classifier, Some(calibration.clone()), masks);
        let online = online.as_mut().unwrap();
        // One frame more than a window, exactly two and three windows, and a last window between them.
        for steps in [window + 1, window + window / 2, STEPS] {
            let view = SweepView::new(&unequal, vec![long]).window(0, steps);
            let offline = |method| classifier.log_probabilities(&view, method).unwrap();
            let dropout = PredictionMethod::McDropout { mc_samples: masks };
            online.begin();
            for (frame, values) in view.sweep(0).chunks_exact(16).enumerate() {
                online.push(values);
                // A belief in between changes nothing.
                if frame == window + 7 {
                    online.classify();
                }
            }
            assert_eq!(online.frames(), steps);
            let close = |found: &[f64], expected: &[f64]| {
                for (found, expected) in found.iter().zip(expected) {
                    // The bound of all online predictions.
                    assert!(
                        (found.exp() - expected.exp()).abs() < 1e-4,
                        "{layers}, {steps}: {found} {expected}"
                    );
                }
            };
            close(
                online.classify_by_dropout().log_probability,
                &offline(dropout)[0],
            );
            let belief = online.classify();
            close(belief.log_probability, &offline(PredictionMethod::Plain)[0]);
            let embedding = classifier.embed(&view).unwrap();
            let scores = embedding.logits.row(0);
            let energy = -f64::from(scores.iter().map(|score| score.exp()).sum::<f32>().ln());
            // Scores are of the order of one.
            let found = belief.strangeness.unwrap();
            assert!(
                (found - energy).abs() < 1e-3,
                "{layers}, {steps}: {found} {energy}"
            );
        }
    }
}

#[test]
fn accuracy_by_length_is_evaluated_for_unequal_lengths_alone() {
    let (whole, unequal) = (twin(), unequal());
    let groups = |dataset: &Dataset| -> Vec<LengthAccuracy> {
        let fold = fold(dataset);
        let classifier = baseline(&fold.train, "means").unwrap();
        let mut ways = evaluate_all_ways(&classifier, &fold.test, 0, 3, Seed(1)).unwrap();
        ways.remove(0).1.by_length
    };
    assert!(groups(&whole).is_empty());
    let groups = groups(&unequal);
    assert_eq!(groups.len(), 4);
    assert_eq!(
        groups.iter().map(|group| group.accuracy.n).sum::<usize>(),
        24
    );
    assert!(groups.is_sorted_by(|a, b| a.longest < b.shortest));
}

#[test]
fn sweeps_that_a_model_cannot_classify_are_refused() {
    let (whole, unequal) = (twin(), unequal());
    let refused = |classifier: &Classifier, dataset: &Dataset| {
        let view = SweepView::all(dataset);
        let scored = classifier.log_probabilities(&view, PredictionMethod::Plain);
        scored.unwrap_err().to_string()
    };
    let classifier = baseline(&fold(&whole).train, "means").unwrap();
    let text = refused(&classifier, &unequal);
    assert!(
        text.contains("at least 360 steps, as all training sweeps"),
        "{text}"
    );
    // Spectra need a window; any other number of steps is classified.
    let train = TrainSplit::all(&unequal, Seed(1));
    let spectra = network(&train, NETWORKS[1], 1);
    let mut lengths = random_lengths(whole.len());
    lengths[3] = 10;
    let short = whole.clone().with_lengths(lengths).unwrap();
    let text = refused(&spectra, &short);
    assert!(
        text.contains("a window of the network, the data set has 10 steps"),
        "{text}"
    );
    let half = whole.first_steps(200).unwrap();
    assert_eq!(scores(&spectra, &SweepView::all(&half)).len(), half.len());
    // A short sweep among the training sweeps is refused before the fit.
    let train = TrainSplit::all(&short, Seed(1));
    let text = baseline(&train, "svm-h").err().unwrap().to_string();
    assert!(text.contains("a window of 0.1 s"), "{text}");
}

#[test]
fn levels_are_removed_from_the_frames_of_a_sweep_alone() {
    let mut values: Vec<f32> = (0..8).map(|step| step as f32).collect();
    values.extend([5.0, 6.0, 7.0, 8.0, 0.0, 0.0, 0.0, 0.0]);
    let shape = tactnet_data::SweepShape {
        steps: 8,
        rows: 1,
        cols: 1,
    };
    let labels = tactnet_data::LabelSet::new(["cork", "felt"]).unwrap();
    let records = [0, 1].map(|label| SweepRecord::new(label, 0)).to_vec();
    let dataset = Dataset::new("two", 100.0, shape, labels, records, Samples::F32(values))
        .and_then(|dataset| dataset.with_lengths(vec![8, 4]))
        .unwrap();
    let train = TrainSplit::all(&dataset, Seed(1));
    let normalizer = crate::Normalizer::fit(crate::Scaling::PerTaxel, MeanRemoval::None, &train);
    // Twelve frames with the sum 28 + 26.
    assert_eq!(normalizer.offset(), [4.5]);
    let normalizer =
        crate::Normalizer::fit(crate::Scaling::PerTaxel, MeanRemoval::PerSweep, &train);
    assert_eq!(normalizer.offset(), [0.0]);
}
