//! Conditions as inputs: known ones help, unknown ones cost little, and every way of prediction agrees.

use rand::RngExt;
use tactnet_data::{
    Condition, ConditionValues, Dataset, Fold, LabelSet, Samples, Scheme, Seed, SweepRecord,
    SweepShape, SweepView,
};
use tactnet_models::Compute;

use crate::{
    Classifier, MeanRemoval, NetworkRecipe, Normalizer, OnlineClassifier, PredictionMethod,
    RegressionReport, Scaling, train_network,
};

const SHAPE: SweepShape = SweepShape {
    steps: 128,
    rows: 2,
    cols: 2,
};
/// Sample rate, in Hz.
const RATE: f64 = 200.0;

/// Returns sweeps of four materials, with two spatial frequencies and two levels. Frequency scales with the speed and level with the force of
/// a sweep, both log-uniform between 2/3 and 3/2: half of the sweeps are ambiguous without each.
fn sweeps(each: usize, seed: u64) -> Dataset {
    let mut rng = Seed(seed).rng("sweeps");
    let (mut values, mut records) = (Vec::new(), Vec::new());
    let [mut speeds, mut forces] = [Vec::new(), Vec::new()];
    for index in 0..4 * each {
        let (label, sweep) = (index / each, index % each);
        let reach = 1.5_f64.ln();
        let [speed, force] = [(); 2].map(|()| rng.random_range(-reach..reach).exp());
        let frequency = [15.0, 22.5][label / 2] * speed;
        let level = [60.0, 90.0][label % 2] * force;
        let phases = [(); 4].map(|()| rng.random_range(0.0..std::f64::consts::TAU));
        for step in 0..SHAPE.steps {
            for phase in phases {
                let angle = std::f64::consts::TAU * frequency * step as f64 / RATE + phase;
                let noise: f64 = rng.random_range(-3.0..3.0);
                values.push((level * (1.0 + 0.1 * angle.sin()) + noise) as f32);
            }
        }
        records.push(SweepRecord::new(label, sweep));
        speeds.push(30.0 * speed as f32);
        forces.push(2.0 * force as f32);
    }
    let labels = LabelSet::new(["a", "b", "c", "d"]).unwrap();
    let conditions = [("speed [mm/s]", speeds), ("force [N]", forces)];
    let conditions = conditions.map(|(name, values)| ConditionValues {
        condition: Condition::of_name(name).unwrap(),
        values,
    });
    let samples = Samples::F32(values);
    let dataset = Dataset::new("made", RATE, SHAPE, labels, records, samples).unwrap();
    dataset.with_conditions(&conditions).unwrap()
}

fn trained(dataset: &Dataset, layers: &str, epochs: usize, seed: u64) -> Classifier {
    let text = format!(
        "name = \"small\"\nnetwork = {{ {layers}, hidden = 32 }}\ninput = {{ scaling = \"per-taxel\" }}\n\
         [training]\nepochs = {epochs}\nbatch = 16\nlearning_rate = 0.005\nmethod = {{ kind = \"base\" }}\n"
    );
    let recipe = NetworkRecipe::parse("small", &text).unwrap();
    let fold = Fold::new(dataset, Scheme::TrainOnAll, Seed(seed), 0, 0).unwrap();
    let device = Compute::Cpu.open().unwrap();
    let trained = train_network(&recipe, &fold.train, Seed(seed), &device, |_| true);
    trained.unwrap().unwrap()
}

fn accuracy(classifier: &Classifier, dataset: &Dataset) -> f64 {
    let view = SweepView::all(dataset);
    let found = classifier.predict(&view, PredictionMethod::Plain).unwrap();
    found.accuracy()
}

const SPECTRA: &str = "spectra = { bands = 12, taxel_units = 8, units = 24 }";

/// Predicted before the first run: about 56 % without conditions (two independent halves of 75 %), over 85 % with them, and within 8 points
/// of the first if they are unknown at prediction.
#[test]
fn known_conditions_help_and_unknown_ones_cost_little() {
    for seed in [1, 2] {
        let (train, test) = (sweeps(60, seed), sweeps(150, seed + 100));
        let (train_bare, test_bare) = (train.without_conditions(), test.without_conditions());
        let with = trained(&train, SPECTRA, 40, seed);
        let without = trained(&train_bare, SPECTRA, 40, seed);
        let known = accuracy(&with, &test);
        let unknown = accuracy(&with, &test_bare);
        let ordinary = accuracy(&without, &test_bare);
        let text = format!("seed {seed}: known {known}, unknown {unknown}, ordinary {ordinary}");
        // Shares of 600 sweeps have standard errors of at most 2 points.
        assert!(known > ordinary + 0.15, "{text}");
        assert!(unknown > ordinary - 0.08, "{text}");
        // A classifier without conditions ignores them.
        assert_eq!(accuracy(&without, &test), ordinary);
    }
}

#[test]
fn unknown_conditions_are_those_of_the_training_mean_offline_and_frame_by_frame() {
    let (train, test) = (sweeps(12, 1), sweeps(3, 2));
    let bare = test.without_conditions();
    for layers in [SPECTRA, "maps = [4, 4]"] {
        let classifier = trained(&train, layers, 2, 1);
        let config = classifier.config();
        assert_eq!(config.taxel_shape(), SHAPE);
        let log_p = |dataset: &Dataset| {
            let view = SweepView::all(dataset);
            classifier
                .log_probabilities(&view, PredictionMethod::Plain)
                .unwrap()
        };
        let (known, unknown) = (log_p(&test), log_p(&bare));
        assert_ne!(known, unknown);
        let means = config
            .conditions
            .columns()
            .iter()
            .map(|of| ConditionValues {
                condition: of.condition.clone(),
                values: vec![of.mean; test.len()],
            });
        let means: Vec<ConditionValues> = means.collect();
        let at_means = bare.clone().into_owned().with_conditions(&means).unwrap();
        assert_eq!(log_p(&at_means), unknown);
        // The order of the conditions does not matter.
        let mut turned = test.condition_values();
        turned.reverse();
        let turned = bare.clone().into_owned().with_conditions(&turned).unwrap();
        assert_eq!(log_p(&turned), known);

        let mut online = OnlineClassifier::new(&classifier, None, 0).unwrap();
        for (dataset, offline) in [(&*bare, &unknown), (&test, &known)] {
            for (sweep, expected) in offline.iter().enumerate() {
                online.begin();
                let taxels = dataset.shape().taxels();
                for frame in dataset.sweep(sweep).chunks_exact(taxels) {
                    online.push(frame);
                }
                for (found, expected) in online.classify().log_probability.iter().zip(expected) {
                    // Another implementation of the same network.
                    assert!((found.exp() - expected.exp()).abs() < 1e-4, "{layers}");
                }
            }
        }
    }
}

#[test]
fn a_condition_in_another_unit_is_refused_and_one_without_a_unit_is_not() {
    let (train, test) = (sweeps(12, 1), sweeps(1, 2));
    let classifier = trained(&train, "maps = [4]", 1, 1);
    let speed = |name: &str| {
        let speed = ConditionValues {
            condition: Condition::of_name(name).unwrap(),
            values: vec![30.0; 4],
        };
        let bare = test.without_conditions().into_owned();
        bare.with_conditions(&[speed]).unwrap()
    };
    let config = classifier.config();
    assert!(config.with_own_conditions(&speed("Speed")).is_ok());
    let refused = config
        .with_own_conditions(&speed("speed [m/s]"))
        .unwrap_err();
    assert!(refused.to_string().contains("values in m/s"), "{refused}");
    let findings = config.conformed(speed("speed")).unwrap();
    let findings = findings.reading_findings();
    assert_eq!(findings.len(), 1, "the force is missing: {findings:?}");
}

#[test]
fn conditions_are_scaled_like_taxels_and_a_constant_one_is_zero_whatever_its_value() {
    let dataset = sweeps(5, 1);
    let mut conditions = dataset.condition_values();
    // A mean with a rounding error.
    conditions[1].values.fill(0.1);
    let bare = dataset.without_conditions().into_owned();
    let dataset = bare.with_conditions(&conditions).unwrap();
    let fold = Fold::new(&dataset, Scheme::TrainOnAll, Seed(1), 0, 0).unwrap();
    for scaling in [Scaling::PerTaxel, Scaling::Digits] {
        for levels in [MeanRemoval::None, MeanRemoval::PerSweep] {
            let normalizer = Normalizer::fit(scaling, levels, &fold.train);
            let mut values: Vec<f32> = (0..20).flat_map(|at| dataset.sweep(at)).collect();
            values
                .iter_mut()
                .skip(5)
                .step_by(6)
                .for_each(|force| *force += 7.0);
            normalizer.apply(&mut values, dataset.shape());
            let spread = |column: usize| {
                let of = || values.iter().skip(column).step_by(6).map(|v| f64::from(*v));
                let count = values.len() as f64 / 6.0;
                let mean = of().sum::<f64>() / count;
                (of().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt()
            };
            let taxels = (0..4).map(spread).sum::<f64>() / 4.0;
            // Single precision.
            assert!(
                (spread(4) / taxels - 1.0).abs() < 1e-3,
                "{scaling:?} {levels:?}"
            );
            assert!(values.iter().skip(5).step_by(6).all(|force| *force == 0.0));
        }
    }
}

#[test]
fn a_regression_recovers_what_the_sweeps_show_and_nothing_else() {
    let dataset = sweeps(40, 1);
    let report = |dataset: &Dataset| {
        let scheme = Scheme::default_for(dataset);
        let report = RegressionReport::of(dataset, None, scheme, Seed(1)).unwrap();
        report.conditions
    };
    let found = report(&dataset);
    for of in &found {
        assert_eq!((of.sweeps, of.units), (160, 160));
        // The sweeps show products of speed or force and a factor of the material, of equal spread.
        assert!((0.2..0.9).contains(&of.r2.value), "{of:?}");
        assert!(of.rmse.value < of.rmse_of_guessing);
        assert!(of.r2.ci95_low < of.r2.value && of.r2.value < of.r2.ci95_high);
    }
    // Numbers of other sweeps are not recovered.
    let mut conditions = dataset.condition_values();
    for of in &mut conditions {
        tactnet_data::shuffle(&mut of.values, &mut Seed(3).rng("shuffled"));
    }
    let bare = dataset.without_conditions().into_owned();
    for of in report(&bare.with_conditions(&conditions).unwrap()) {
        assert!(of.r2.value < 0.1, "{of:?}");
    }
}
