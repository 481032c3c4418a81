use rand::RngExt;
use tactnet_data::Seed;
use tactnet_pipeline::SplitKind;

use super::*;
use crate::Measure;
use crate::report::fake;
use crate::statistic::Statistic;
use crate::summary::Summary;

/// Models of the tests.
const MODELS: [&str; 3] = ["lda", "fast", "committee"];

/// A contender of the tests.
struct Entry<'a> {
    data: &'a str,
    model: &'a str,
    folds: Vec<f64>,
    split: SplitKind,
    shots: Option<usize>,
}

fn summary_of(entries: &[Entry<'_>]) -> Summary {
    let mut summary = fake::empty();
    let materials = ["cork".to_string(), "felt".into()];
    for (k, entry) in entries.iter().enumerate() {
        // A name of its own, so that rows find their contender.
        let data = format!("{k}");
        fake::add(&mut summary, &data, entry.model, 0.5, &materials);
        let added = summary.contenders.len() - 1;
        let contender = &mut summary.contenders[added];
        contender.data = entry.data.into();
        contender.split_kind = entry.split;
        contender.shots = entry.shots;
        contender.committee = entry.model == "committee";
        let key = contender.key.clone();
        for row in summary.rows.iter_mut().filter(|row| row.contender == key) {
            row.data = entry.data.into();
            if row.is_one_sweep_accuracy() {
                row.statistic = Statistic::of_shares(entry.folds.clone(), 0.25);
            }
            if row.measure == Measure::TrainSeconds {
                row.statistic = Statistic::of(vec![1.0 + added as f64], 0.25);
            }
        }
    }
    summary
}

fn benchmark_of(entries: &[Entry<'_>], left_out: &[LeftOut]) -> Option<Benchmark> {
    Benchmark::of(&summary_of(entries).scored(), left_out)
}

/// Returns a benchmark on random folds without differences between folds.
///
/// - `sets`: names of data sets, with an accuracy for each of the models, or none if the model is left out
pub(crate) fn of_accuracies(sets: &[(&str, &[Option<f64>])]) -> Benchmark {
    let (mut entries, mut left_out) = (Vec::new(), Vec::new());
    for (data, accuracies) in sets {
        for (model, accuracy) in MODELS.into_iter().zip(*accuracies) {
            match accuracy {
                Some(accuracy) => entries.push(Entry {
                    data,
                    model,
                    folds: vec![*accuracy; 2],
                    split: SplitKind::KFold,
                    shots: None,
                }),
                None => left_out.push(LeftOut {
                    model: model.into(),
                    data: (*data).into(),
                    shots: None,
                    reason: "too short".into(),
                }),
            }
        }
    }
    benchmark_of(&entries, &left_out).unwrap()
}

/// Returns a benchmark of two models on two data sets, with all training sweeps and with few.
pub(crate) fn shots_of(shots: usize) -> Benchmark {
    let mut entries = Vec::new();
    for data in ["cork", "felt"] {
        for model in ["lda", "fast"] {
            for shots in [None, Some(shots)] {
                entries.push(Entry {
                    data,
                    model,
                    folds: vec![0.9, 0.8],
                    split: SplitKind::KFold,
                    shots,
                });
            }
        }
    }
    benchmark_of(&entries, &[]).unwrap()
}

#[test]
fn mean_errors_and_ranks_are_those_of_the_data_sets() {
    let mut rng = Seed(9).rng("tables");
    for _ in 0..50 {
        let sets = rng.random_range(2..6);
        let table: Vec<Vec<Option<f64>>> = (0..sets)
            .map(|_| {
                let tenths = MODELS.map(|_| rng.random_range(1..10));
                let accuracies = tenths.map(|tenths: u8| Some(f64::from(tenths) / 10.0));
                accuracies.to_vec()
            })
            .collect();
        let names: Vec<String> = (0..sets).map(|set| format!("set {set}")).collect();
        let rows: Vec<(&str, &[Option<f64>])> = names
            .iter()
            .zip(&table)
            .map(|(name, row)| (name.as_str(), row.as_slice()))
            .collect();
        let benchmark = of_accuracies(&rows);
        for scores in &benchmark.conditions {
            let sum_of_ranks: f64 = scores.models.iter().filter_map(|of| of.mean_rank).sum();
            // Mean ranks of three models sum to 1 + 2 + 3; sums of a few halves are nearly exact.
            assert!((sum_of_ranks - 6.0).abs() < 1e-12);
            for (k, model) in scores.models.iter().enumerate() {
                let errors = table.iter().map(|row| 1.0 - row[k].unwrap());
                let mean = errors.sum::<f64>() / table.len() as f64;
                assert!((model.mean_error.unwrap() - mean).abs() < 1e-12);
                assert_eq!(model.sets, table.len());
            }
        }
        let least = benchmark.conditions[0]
            .models
            .iter()
            .filter_map(|of| of.mean_error)
            .fold(1.0, f64::min);
        let best = benchmark.conditions[0].best().unwrap();
        assert!((best.mean_error.unwrap() - least).abs() < 1e-12);
    }
}

#[test]
fn held_out_groups_are_the_headline_where_a_data_set_has_them() {
    let mut entries = Vec::new();
    for (data, split, accuracy) in [
        ("walking", SplitKind::GroupKFold, 0.7),
        ("walking", SplitKind::KFold, 0.9),
        ("grasps", SplitKind::KFold, 0.5),
    ] {
        for model in ["lda", "fast"] {
            entries.push(Entry {
                data,
                model,
                folds: vec![accuracy; 2],
                split,
                shots: None,
            });
        }
    }
    let benchmark = benchmark_of(&entries, &[]).unwrap();
    let error = |condition| {
        benchmark.under(condition).unwrap().models[0]
            .mean_error
            .unwrap()
    };
    assert_eq!(benchmark.conditions[0].condition, Condition::Headline);
    assert!(
        (error(Condition::Headline) - 0.4).abs() < 1e-12,
        "of 30 % and 50 %"
    );
    assert!((error(Condition::HeldOutGroups) - 0.3).abs() < 1e-12);
    assert_eq!(benchmark.default.model.as_deref(), Some("lda"));
    assert!(
        (error(Condition::RandomFolds) - 0.3).abs() < 1e-12,
        "of 10 % and 50 %"
    );
}

#[test]
fn a_model_that_is_left_out_has_the_last_rank_and_no_error_there() {
    let benchmark = of_accuracies(&[
        ("felt", &[Some(0.9), Some(0.8), None]),
        ("cork", &[Some(0.6), Some(0.7), Some(0.8)]),
    ]);
    let committee = &benchmark.conditions[0].models[2];
    assert_eq!((committee.sets, committee.mean_rank), (1, Some(2.0)));
    assert!((committee.mean_error.unwrap() - 0.2).abs() < 1e-12);
    let candidate = benchmark
        .default
        .candidates
        .iter()
        .find(|of| of.model == "committee");
    assert_eq!(candidate.unwrap().objections[0].data, "felt");
    assert_ne!(benchmark.default.model.as_deref(), Some("committee"));
}

#[test]
fn an_unfinished_data_set_is_shown_but_not_averaged() {
    let mut entries = Vec::new();
    for (data, model) in [("cork", "lda"), ("cork", "fast"), ("felt", "lda")] {
        entries.push(Entry {
            data,
            model,
            folds: vec![0.9; 2],
            split: SplitKind::KFold,
            shots: None,
        });
    }
    let benchmark = benchmark_of(&entries, &[]).unwrap();
    let headline = &benchmark.conditions[0];
    assert_eq!(headline.sets.len(), 2);
    assert_eq!(headline.sets[1].models[0].rank, None);
    assert_eq!(headline.models[0].sets, 1);
}

#[test]
fn the_default_is_nowhere_worse_than_the_best_single_model_by_more_than_its_interval() {
    let of = |committee_on_felt: Vec<f64>| {
        let mut entries = Vec::new();
        for (data, model, folds) in [
            ("cork", "lda", vec![0.5, 0.52]),
            ("cork", "fast", vec![0.6, 0.62]),
            ("cork", "committee", vec![0.9, 0.92]),
            ("felt", "lda", vec![0.9, 0.92]),
            ("felt", "fast", vec![0.8, 0.82]),
            ("felt", "committee", committee_on_felt),
        ] {
            entries.push(Entry {
                data,
                model,
                folds,
                split: SplitKind::KFold,
                shots: None,
            });
        }
        benchmark_of(&entries, &[]).unwrap().default
    };
    // Its interval on felt holds the 91 % of LDA.
    assert_eq!(of(vec![0.8, 0.86]).model.as_deref(), Some("committee"));
    // Without an interval, no lead is allowed; the single models are worse than each other somewhere.
    let refused = of(vec![0.85, 0.85]);
    assert_eq!(refused.candidates[0].model, "committee");
    let objection = &refused.candidates[0].objections[0];
    assert_eq!(objection.best_single.as_deref(), Some("lda"));
    assert!((objection.behind.unwrap() - 0.06).abs() < 1e-12);
    assert_ne!(refused.model.as_deref(), Some("committee"));
}

#[test]
fn one_data_set_is_no_benchmark() {
    let entry = |model| Entry {
        data: "cork",
        model,
        folds: vec![0.9; 2],
        split: SplitKind::KFold,
        shots: None,
    };
    assert_eq!(benchmark_of(&[entry("lda"), entry("fast")], &[]), None);
}
