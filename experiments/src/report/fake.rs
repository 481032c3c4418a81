//! Small summaries for the tests of the page.

use std::collections::BTreeMap;

use crate::published_confusion::TACTMAT_MATERIALS;
use crate::{
    Audit, Comparison, FeatureMap, FoldRecord, Grouping, Published, ReliabilityBin, RiskCoverage,
    Row, SampleEfficiency, Statistic, Study, StudyComparison, StudyRecord, StudyRow, StudySummary,
    Summary,
};

/// Must never reach the page as it is.
pub(super) const HOSTILE: &str = "<b>&\"</b></script>'";

/// Nothing has ended yet.
pub(super) fn empty() -> Summary {
    Summary {
        schema_version: Summary::SCHEMA_VERSION,
        name: "empty".into(),
        title: "Nothing yet".into(),
        expects: String::new(),
        command: "tactnet experiment".into(),
        git: vec![],
        seed: 1,
        tasks_done: 0,
        tasks: 4,
        train_seconds: 0.0,
        processors: vec![],
        data_sha256: BTreeMap::new(),
        rows: vec![],
        comparisons: vec![],
        audits: vec![],
        groups: BTreeMap::new(),
        study: None,
    }
}

/// Three models on three data sets, a probe, and text that wants to be markup everywhere.
pub(super) fn summary() -> Summary {
    let materials: Vec<String> = [HOSTILE, "cork", "wood"].map(String::from).to_vec();
    let mut rows = Vec::new();
    for data in ["biotac", HOSTILE, "third"] {
        for (model, accuracy) in [("net", 0.9), ("knn", 0.7), (HOSTILE, 0.8)] {
            rows.push(row(data, model, accuracy, &materials));
        }
    }
    rows[1].probe = true;
    let first = rows[0].key.clone();
    let grouping = Grouping {
        group_of: vec![0, 1, 0],
        accuracy: 0.95,
        stability: Some(0.8),
        consecutive: false,
    };
    Summary {
        title: HOSTILE.into(),
        expects: HOSTILE.into(),
        git: vec![HOSTILE.into()],
        tasks_done: 4,
        processors: vec![HOSTILE.into()],
        data_sha256: BTreeMap::from([(HOSTILE.into(), HOSTILE.into())]),
        comparisons: vec![Comparison {
            first: first.clone(),
            second: HOSTILE.into(),
            difference: -0.02,
            folds: 2,
            p: Some(0.0004),
        }],
        audits: vec![Audit {
            data: HOSTILE.into(),
            chance: 1.0 / 3.0,
            best: Some((HOSTILE.into(), 0.9)),
            block_out: None,
            means: Some(0.5),
            permuted: Some(0.3),
            chance_sigma: 0.05,
            verdict: HOSTILE.into(),
        }],
        groups: BTreeMap::from([(first, grouping)]),
        study: None,
        rows,
        ..empty()
    }
}

/// One model on TactMat's materials.
pub(super) fn tactmat() -> Summary {
    let materials: Vec<String> = TACTMAT_MATERIALS
        .iter()
        .map(|name| name.to_string())
        .collect();
    Summary {
        tasks_done: 4,
        rows: vec![
            row("twin", "net", 0.8, &materials),
            row("twin", "knn", 0.6, &materials),
        ],
        ..empty()
    }
}

/// An n-shot study with text that wants to be markup everywhere.
pub(super) fn study() -> Summary {
    let mut rows = Vec::new();
    for method in ["nk", "ol-mean", HOSTILE] {
        for shots in [1, 10, 80] {
            rows.push(StudyRow {
                data: HOSTILE.into(),
                levels: "kept".into(),
                model: HOSTILE.into(),
                measure: "accuracy".into(),
                method: method.into(),
                setting: HOSTILE.into(),
                shots: Some(shots),
                sweeps: None,
                mean: 0.5 + 0.005 * shots as f64,
                sd: Some(0.1),
                ci95_low: Some(0.4),
                ci95_high: Some(0.9),
                n: 2,
                decisions: 600,
                values: vec![0.4, 0.6],
                tactmat: true,
                published: Some(0.755),
                humans: None,
            });
        }
    }
    let study = StudySummary {
        kind: Study::Nshot,
        rows,
        comparisons: vec![StudyComparison {
            data: HOSTILE.into(),
            model: HOSTILE.into(),
            levels: "kept".into(),
            measure: "accuracy".into(),
            setting: String::new(),
            shots: Some(1),
            sweeps: None,
            first: HOSTILE.into(),
            second: "ol-mean".into(),
            difference: -0.1,
            ci95_low: Some(-0.2),
            ci95_high: Some(0.0),
            p: Some(0.01),
            n: 2,
        }],
        sample_efficiency: vec![SampleEfficiency {
            data: HOSTILE.into(),
            model: HOSTILE.into(),
            levels: "kept".into(),
            transfer_shots: 1,
            accuracy: 0.7,
            shots: Some(12.5),
            ci95: Some([Some(9.0), None]),
            published_ratio: Some(15.0),
        }],
        maps: vec![FeatureMap {
            choice: HOSTILE.into(),
            space: "input".into(),
            materials: vec![HOSTILE.into(), "cork".into()],
            labels: vec![0, 1, 1],
            points: vec![[0.0, 1.0], [-3.0, 2.0], [5.0, -7.0]],
        }],
        tasks: vec![StudyRecord {
            id: HOSTILE.into(),
            split: HOSTILE.into(),
            split_sha256: "ab".repeat(32),
            recipe_sha256: "cd".repeat(32),
            git: "0123456789abcdef".into(),
            seconds: 12.0,
            chosen: BTreeMap::from([(HOSTILE.into(), 0.1)]),
        }],
    };
    Summary {
        tasks_done: 4,
        study: Some(study),
        ..empty()
    }
}

fn row(data: &str, model: &str, accuracy: f64, materials: &[String]) -> Row {
    let size = materials.len();
    let right = (10.0 * accuracy) as usize;
    let confusion = (0..size)
        .map(|truth| {
            let mut counts = vec![0; size];
            counts[truth] = right;
            counts[(truth + 1) % size] += 10 - right;
            counts
        })
        .collect();
    let folds = vec![accuracy - 0.01, accuracy + 0.01];
    let statistic = |mean: f64| Statistic::of(vec![mean, 1.1 * mean], 0.25);
    Row {
        key: format!("{data}/{model}"),
        data: data.into(),
        model: model.into(),
        levels: "kept".into(),
        split: "k_fold".into(),
        prediction: "mc_dropout".into(),
        steps: 1000,
        probe: false,
        materials: materials.to_vec(),
        one_sweep: Statistic::of(folds.clone(), 0.25),
        three_sweeps: Some(statistic(0.85)),
        sigma_test: 0.01,
        negative_log_likelihood: statistic(0.4),
        expected_calibration_error: statistic(0.03),
        brier: statistic(0.2),
        train_seconds: statistic(200.0),
        n_train: 80,
        n_test: 20,
        confusion,
        reliability: vec![
            ReliabilityBin {
                confidence: 0.5,
                accuracy: 0.4,
                count: 10,
            },
            ReliabilityBin {
                confidence: 0.95,
                accuracy: 0.9,
                count: 40,
            },
        ],
        risk_coverage: (1..=20)
            .map(|k| {
                let coverage = k as f64 / 20.0;
                RiskCoverage {
                    coverage,
                    risk: 0.2 * coverage,
                }
            })
            .collect(),
        published: Some(Published {
            classifier: HOSTILE.into(),
            one_sweep: 86.3,
            three_sweeps: 95.0,
        }),
        folds: folds
            .iter()
            .enumerate()
            .map(|(fold, &one_sweep)| FoldRecord {
                repeat: 0,
                fold,
                command: HOSTILE.into(),
                git: "0123456789abcdef".into(),
                split_sha256: "ab".repeat(32),
                recipe_sha256: "cd".repeat(32),
                predictions: format!("tasks/{HOSTILE}/predictions.csv"),
                one_sweep,
            })
            .collect(),
    }
}
