//! Small summaries for the tests of reports.

use std::collections::BTreeMap;

use crate::published_confusion::TACTMAT_MATERIALS;
use crate::row::tests::row;
use tactnet_data::DataOrigin;
use tactnet_pipeline::{Estimate, LengthAccuracy, MeanRemoval, PredictionMethod, SplitKind};

use crate::{
    Audit, Comparison, Contender, Crossval, DataRecord, FeatureMap, FoldRecord, Grouping, Measure,
    Nshot, Part, PublishedContender, Question, ReliabilityBin, RiskCoverage, Row, SampleEfficiency,
    Statistic, Summary, TaskRecord,
};

/// Text that must be escaped.
pub(super) const HOSTILE: &str = "<b>&\"</b></script>'";

/// Returns a summary without finished tasks.
pub(crate) fn empty() -> Summary {
    Summary {
        schema_version: Summary::SCHEMA_VERSION,
        name: "empty".into(),
        title: "Nothing yet".into(),
        expects: String::new(),
        command: "tactnet experiment".into(),
        question: Question::Crossval(Crossval::default()),
        data_warnings: vec![],
        left_out: vec![],
        git: vec![],
        seed: 1,
        tasks_done: 0,
        tasks: 4,
        tasks_running: 0,
        failed: Vec::new(),
        train_seconds: 0.0,
        processors: vec![],
        data: BTreeMap::new(),
        rows: vec![],
        comparisons: vec![],
        benchmark: None,
        audits: vec![],
        groups: BTreeMap::new(),
        records: vec![],
        contenders: vec![],
        sample_efficiency: None,
        maps: vec![],
    }
}

/// Returns a summary of three models on three data sets and a probe, with hostile text everywhere.
pub(super) fn summary() -> Summary {
    let materials: Vec<String> = [HOSTILE, "cork", "wood"].map(String::from).to_vec();
    let mut all = empty();
    for data in ["biotac", HOSTILE, "third"] {
        for (model, accuracy) in [("net", 0.9), ("knn", 0.7), (HOSTILE, 0.8)] {
            add(&mut all, data, model, accuracy, &materials);
        }
    }
    all.contenders[1].probe = true;
    let first = all.contenders[0].key.clone();
    all.contenders[0].by_length = vec![LengthAccuracy {
        shortest: 300,
        longest: 500,
        accuracy: Estimate::wilson(0.75, 40),
    }];
    let grouping = Grouping {
        group_of: vec![0, 1, 0],
        accuracy: 0.95,
        accuracy_of_three: Some(0.97),
        stability: Some(0.8),
        consecutive: false,
    };
    Summary {
        title: HOSTILE.into(),
        expects: HOSTILE.into(),
        git: vec![HOSTILE.into()],
        tasks_done: 4,
        processors: vec![HOSTILE.into()],
        data: BTreeMap::from([(
            HOSTILE.into(),
            DataRecord {
                sha256: HOSTILE.into(),
                origin: DataOrigin::Recorded,
                assumed_rate_hz: None,
            },
        )]),
        comparisons: vec![Comparison {
            first: all.rows[0].key.clone(),
            second: HOSTILE.into(),
            difference: -0.02,
            ci95: None,
            n: 2,
            p: Some(0.0004),
            p_holm: Some(0.0008),
        }],
        audits: vec![Audit {
            data: HOSTILE.into(),
            chance: 1.0 / 3.0,
            best: Some((HOSTILE.into(), 0.9)),
            tied: vec![HOSTILE.into()],
            block_out: None,
            means: Some(0.5),
            first_frame: None,
            last_frame: None,
            recording_order: None,
            sweep_length: None,
            block_identity: None,
            permuted: Some(0.3),
            permuted_chance: None,
            chance_sigma: 0.05,
            verdict: HOSTILE.into(),
        }],
        groups: BTreeMap::from([(first, grouping)]),
        ..all
    }
}

/// Returns a summary of two models on TactMat's materials.
pub(super) fn tactmat() -> Summary {
    let materials: Vec<String> = TACTMAT_MATERIALS
        .iter()
        .map(|name| name.to_string())
        .collect();
    let mut all = Summary {
        tasks_done: 4,
        ..empty()
    };
    add(&mut all, "sweeps", "net", 0.8, &materials);
    add(&mut all, "sweeps", "knn", 0.6, &materials);
    for contender in &mut all.contenders {
        contender.origin = DataOrigin::Tactmat;
    }
    all
}

/// Returns an n-shot study with hostile text everywhere.
pub(super) fn study() -> Summary {
    let mut rows = Vec::new();
    for method in ["nk", "ol-mean", HOSTILE] {
        for shots in [1, 10, 80] {
            let mut row = row(HOSTILE, HOSTILE, method, Measure::Accuracy);
            row.key = format!("{method} {shots}");
            row.setting = HOSTILE.into();
            row.shots = Some(shots);
            row.statistic = Statistic::of(vec![0.4, 0.6 + 0.001 * shots as f64], 0.0);
            row.published = Some(0.755);
            rows.push(row);
        }
    }
    Summary {
        tasks_done: 4,
        question: Question::Nshot(Nshot {
            splits: 2,
            shots: vec![1, 10, 80],
            methods: vec![],
            new_materials: 6,
            scratch_folds: 1,
            scratch_steps: 300,
            scratch_learning_rate: None,
        }),
        comparisons: vec![Comparison {
            first: rows[6].key.clone(),
            second: rows[3].key.clone(),
            difference: -0.1,
            ci95: Some([-0.2, 0.0]),
            p: Some(0.01),
            p_holm: Some(0.02),
            n: 2,
        }],
        sample_efficiency: Some(vec![SampleEfficiency {
            data: HOSTILE.into(),
            model: HOSTILE.into(),
            levels: MeanRemoval::None,
            transfer_shots: 1,
            accuracy: 0.7,
            shots: Some(12.5),
            ci95: Some([Some(9.0), None]),
            published_ratio: Some(15.0),
        }]),
        maps: vec![FeatureMap {
            choice: HOSTILE.into(),
            space: "input".into(),
            materials: vec![HOSTILE.into(), "cork".into()],
            labels: vec![0, 1, 1],
            points: vec![[0.0, 1.0], [-3.0, 2.0], [5.0, -7.0]],
        }],
        records: vec![record(HOSTILE)],
        rows,
        ..empty()
    }
}

fn record(id: &str) -> TaskRecord {
    TaskRecord {
        id: id.into(),
        part: Part::Draw(0),
        command: HOSTILE.into(),
        split: HOSTILE.into(),
        split_sha256: "ab".repeat(32),
        recipe_sha256: "cd".repeat(32),
        git: vec!["0123456789abcdef".into()],
        seconds: 12.0,
        chosen: BTreeMap::from([(HOSTILE.into(), 0.1)]),
    }
}

/// Returns counts of ten sweeps of each material, of which `right` are predicted as it and the others as the next one.
fn confusion(size: usize, right: usize) -> Vec<Vec<usize>> {
    (0..size)
        .map(|truth| {
            let mut counts = vec![0; size];
            counts[truth] = right;
            counts[(truth + 1) % size] += 10 - right;
            counts
        })
        .collect()
}

fn reliability() -> Vec<ReliabilityBin> {
    vec![
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
    ]
}

fn risk(coverage: f64) -> RiskCoverage {
    RiskCoverage {
        coverage,
        risk: 0.2 * coverage,
    }
}

fn fold_records(task: &str, accuracies: &[f64]) -> Vec<FoldRecord> {
    let record = |(fold, &one_sweep)| FoldRecord {
        task: task.into(),
        repeat: 0,
        fold,
        predictions: format!("tasks/{HOSTILE}/predictions.csv"),
        one_sweep,
    };
    accuracies.iter().enumerate().map(record).collect()
}

/// Adds a contender with its rows and tasks.
pub(crate) fn add(
    summary: &mut Summary,
    data: &str,
    model: &str,
    accuracy: f64,
    materials: &[String],
) {
    let folds = vec![accuracy - 0.01, accuracy + 0.01];
    let statistic = |mean: f64| Statistic::of(vec![mean, 1.1 * mean], 0.25);
    for (measure, sweeps, statistic) in [
        (Measure::Accuracy, 1, Statistic::of(folds.clone(), 0.25)),
        (Measure::BalancedAccuracy, 1, statistic(accuracy)),
        (Measure::Accuracy, 3, statistic(0.85)),
        (Measure::VoteAccuracy, 3, statistic(0.84)),
        (Measure::NegativeLogLikelihood, 1, statistic(0.4)),
        (Measure::ExpectedCalibrationError, 1, statistic(0.03)),
        (Measure::Brier, 1, statistic(0.2)),
        (Measure::TrainSeconds, 1, statistic(200.0)),
    ] {
        summary.rows.push(Row {
            key: format!("{data}/{model}, {measure}, {sweeps}"),
            sweeps: Some(sweeps),
            statistic,
            ..row(data, model, "mc_dropout", measure)
        });
    }
    let task = format!("{HOSTILE}{}", summary.contenders.len());
    summary.records.push(record(&task));
    summary.contenders.push(Contender {
        key: format!("{data}/{model}"),
        data: data.into(),
        origin: DataOrigin::Recorded,
        model: model.into(),
        levels: MeanRemoval::None,
        split: "k_fold".into(),
        split_kind: SplitKind::KFold,
        inner: None,
        shots: None,
        committee: false,
        own_method: true,
        prediction: PredictionMethod::McDropout { mc_samples: 100 },
        steps: 1000,
        training: None,
        network: None,
        probe: false,
        materials: materials.to_vec(),
        n_train: 80,
        n_test: 20,
        sigma_test: 0.01,
        confusion: confusion(materials.len(), (10.0 * accuracy) as usize),
        confounded: None,
        by_length: Vec::new(),
        fused_confusion: vec![],
        reliability: reliability(),
        risk_coverage: (1..=20).map(|k| risk(f64::from(k) / 20.0)).collect(),
        published: Some(PublishedContender {
            classifier: HOSTILE.into(),
            one_sweep: 86.3,
            three_sweeps: 95.0,
        }),
        folds: fold_records(&task, &folds),
    });
}
