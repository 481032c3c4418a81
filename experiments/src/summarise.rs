//! From what the tasks left to the numbers of the report.

use std::collections::{BTreeMap, BTreeSet};

use tactnet_data::{Scheme, SplitManifest};
use tactnet_pipeline::{
    Evaluation, MeanRemoval, PredictionMethod, Predictions, RunConfig, RunDir, RunResult,
    SweepScore,
};

use crate::tasks::{ExperimentDir, TaskState};
use crate::{
    Comparison, ExperimentError, FoldRecord, Published, ReliabilityBin, RiskCoverage, Row,
    Statistic, Study, StudyResult, Summary, Task, audits, grouping_of_counts, published_for,
    resampled_t_test, study_summary,
};

/// Bins of the reliability diagram.
const BINS: usize = 15;
/// Points of the risk-coverage curve.
const COVERAGES: usize = 50;

/// One finished task with everything the summary takes from it.
struct FinishedTask<'a> {
    task: &'a Task,
    config: RunConfig,
    split: SplitManifest,
    result: RunResult,
    run: RunDir,
}

/// One way of predicting of one finished task.
struct Fold<'a> {
    finished: &'a FinishedTask<'a>,
    evaluation: &'a Evaluation,
    predictions: Predictions,
    file: String,
}

/// Reads every task that has finished.
///
/// # Errors
/// A run directory that is damaged.
pub fn summarise(dir: &ExperimentDir) -> Result<Summary, ExperimentError> {
    let recipe = &dir.plan.recipe;
    if let Some(study) = &recipe.study {
        return summarise_study(dir, study.kind);
    }
    let mut finished = Vec::new();
    for task in &dir.plan.tasks {
        if dir.state(task) == TaskState::Done {
            let run = RunDir::open(&dir.task_dir(task))?;
            if let Some(result) = run.result()? {
                finished.push(FinishedTask {
                    task,
                    config: run.config()?,
                    split: run.split()?,
                    result,
                    run,
                });
            }
        }
    }
    let mut by_row: BTreeMap<(usize, String), Vec<Fold<'_>>> = BTreeMap::new();
    let mut order: Vec<String> = Vec::new();
    for finished in &finished {
        for (way, evaluation) in &finished.result.evaluations {
            let key = row_key(finished, way);
            let place = order
                .iter()
                .position(|known| *known == key)
                .unwrap_or_else(|| {
                    order.push(key.clone());
                    order.len() - 1
                });
            let (file, predictions) = finished.run.predictions(way)?;
            by_row.entry((place, key)).or_default().push(Fold {
                finished,
                evaluation,
                predictions,
                file,
            });
        }
    }
    let rows: Vec<Row> = by_row
        .into_iter()
        .map(|((_, key), mut folds)| {
            folds.sort_by_key(|fold| (fold.finished.result.repeat, fold.finished.result.fold));
            unmixed(dir, &key, &folds)?;
            Ok(row(key, &folds))
        })
        .collect::<Result<_, ExperimentError>>()?;
    let mut groups = BTreeMap::new();
    if recipe.groups > 0 {
        for row in rows
            .iter()
            .filter(|row| !row.probe && row.materials.len() > recipe.groups)
        {
            groups.insert(
                row.key.clone(),
                grouping_of_counts(&row.confusion, recipe.groups, row.repeats(), recipe.seed),
            );
        }
    }
    let set = |of: fn(&FinishedTask<'_>) -> Vec<String>| -> Vec<String> {
        finished
            .iter()
            .flat_map(of)
            .collect::<BTreeSet<_>>()
            .into_iter()
            .collect()
    };
    Ok(Summary {
        schema_version: Summary::SCHEMA_VERSION,
        name: recipe.name.clone(),
        title: recipe.title.clone(),
        expects: recipe.expects.clone(),
        command: dir.plan.command.clone(),
        git: set(|e| e.result.git.split(' ').map(String::from).collect()),
        seed: recipe.seed,
        tasks_done: finished.len(),
        tasks: dir.plan.tasks.len(),
        train_seconds: finished.iter().map(|e| e.result.train_seconds).sum(),
        processors: set(|e| {
            e.result
                .provenance
                .iter()
                .map(|p| p.processor.clone())
                .collect()
        }),
        data_sha256: finished
            .iter()
            .map(|e| (e.result.data.clone(), e.result.data_sha256.clone()))
            .collect(),
        comparisons: comparisons(&rows),
        audits: audits(&rows),
        groups,
        rows,
        study: None,
    })
}

fn summarise_study(dir: &ExperimentDir, kind: Study) -> Result<Summary, ExperimentError> {
    let recipe = &dir.plan.recipe;
    let finished = study_summary::ended(dir)?;
    let set = |of: fn(&StudyResult) -> &String| -> Vec<String> {
        let all: BTreeSet<&String> = finished.iter().map(|e| of(&e.result)).collect();
        all.into_iter().cloned().collect()
    };
    Ok(Summary {
        schema_version: Summary::SCHEMA_VERSION,
        name: recipe.name.clone(),
        title: recipe.title.clone(),
        expects: recipe.expects.clone(),
        command: dir.plan.command.clone(),
        git: set(|result| &result.provenance.git),
        seed: recipe.seed,
        tasks_done: finished.len(),
        tasks: dir.plan.tasks.len(),
        train_seconds: finished.iter().map(|e| e.result.seconds).sum(),
        processors: set(|result| &result.provenance.processor),
        data_sha256: finished
            .iter()
            .map(|e| (e.result.data.clone(), e.result.data_sha256.clone()))
            .collect(),
        rows: Vec::new(),
        comparisons: Vec::new(),
        audits: Vec::new(),
        groups: BTreeMap::new(),
        study: Some(study_summary::summary(dir, kind, &finished)?),
    })
}

/// The data set's name without what was done to it.
fn data_name(finished: &FinishedTask<'_>) -> String {
    let name = &finished.result.data;
    name.split(", ").next().unwrap_or(name).into()
}

/// The model's name; a recipe that says more about itself (drawn settings) says it here.
fn shown_model(finished: &FinishedTask<'_>) -> String {
    let (name, title) = (&finished.task.model, &finished.result.recipe);
    if title.starts_with(name.as_str()) {
        title.clone()
    } else {
        name.clone()
    }
}

fn split_name(finished: &FinishedTask<'_>) -> String {
    let scheme = match finished.split.scheme {
        Scheme::StratifiedKFold { folds, .. } => format!("{folds} random folds"),
        Scheme::TestFlag => "author's test sweeps".into(),
        Scheme::LeaveBlockOut => "block left out".into(),
    };
    match finished.config.inner {
        None => scheme,
        Some(part) => format!("{scheme}, judged by inner part {part}"),
    }
}

fn row_key(finished: &FinishedTask<'_>, way: &str) -> String {
    let levels = match finished.config.recipe.levels() {
        MeanRemoval::None => "",
        MeanRemoval::PerSweep => ", levels removed",
    };
    let steps = finished
        .config
        .steps
        .map_or(String::new(), |steps| format!(", {steps} steps"));
    let way = if way == "plain" { "" } else { ", MC dropout" };
    format!(
        "{}{levels}{steps}, {}: {}{way}",
        data_name(finished),
        split_name(finished),
        finished.task.model
    )
}

fn row(key: String, folds: &[Fold<'_>]) -> Row {
    let first = folds[0].finished;
    let (n_train, n_test) = (first.result.n_train, first.result.n_test);
    let share = n_test as f64 / n_train as f64;
    let of =
        |value: &dyn Fn(&Fold<'_>) -> f64| Statistic::of(folds.iter().map(value).collect(), share);
    let shares = |values: Vec<f64>| Statistic::of_shares(values, share);
    let one_sweep = shares(folds.iter().map(|f| f.evaluation.one_sweep.mean).collect());
    let fused: Option<Vec<f64>> = folds
        .iter()
        .map(|f| f.evaluation.fused.as_ref().map(|fused| fused.bayes.mean))
        .collect();
    let way = folds[0].evaluation.method;
    let materials: Vec<String> = first
        .config
        .classifier
        .labels
        .names()
        .map(String::from)
        .collect();
    let mut confusion = vec![vec![0; materials.len()]; materials.len()];
    for fold in folds {
        for (sum, counts) in confusion.iter_mut().zip(fold.predictions.confusion()) {
            sum.iter_mut()
                .zip(counts)
                .for_each(|(sum, count)| *sum += count);
        }
    }
    let sweeps: Vec<&SweepScore> = folds.iter().flat_map(|f| &f.predictions.sweeps).collect();
    Row {
        key,
        data: data_name(first),
        model: shown_model(first),
        levels: first.config.recipe.levels().name().into(),
        split: split_name(first),
        prediction: way.name().into(),
        steps: first.config.classifier.shape.steps,
        probe: first.task.probe.is_some(),
        sigma_test: (one_sweep.mean * (1.0 - one_sweep.mean) / n_test as f64).sqrt(),
        three_sweeps: fused.map(shares),
        negative_log_likelihood: of(&|f| f.evaluation.negative_log_likelihood),
        expected_calibration_error: of(&|f| f.evaluation.expected_calibration_error),
        brier: of(&|f| f.evaluation.brier),
        train_seconds: of(&|f| f.finished.result.train_seconds),
        one_sweep,
        n_train,
        n_test,
        confusion,
        reliability: reliability(&sweeps),
        risk_coverage: risk_coverage(&sweeps),
        published: published(first, way),
        folds: folds.iter().map(record).collect(),
        materials,
    }
}

/// Folds of one row come from one data set and one recipe, each once.
fn unmixed(dir: &ExperimentDir, key: &str, folds: &[Fold<'_>]) -> Result<(), ExperimentError> {
    let first = &folds[0].finished.result;
    for (what, mixed) in [
        (
            "data sets (the file has changed between tasks)",
            folds
                .iter()
                .any(|f| f.finished.result.data_sha256 != first.data_sha256),
        ),
        (
            "recipes",
            folds
                .iter()
                .any(|f| f.finished.result.recipe_sha256 != first.recipe_sha256),
        ),
        (
            "results of one fold",
            folds.windows(2).any(|pair| {
                let place =
                    |fold: &Fold<'_>| (fold.finished.result.repeat, fold.finished.result.fold);
                place(&pair[0]) == place(&pair[1])
            }),
        ),
    ] {
        if mixed {
            return Err(ExperimentError::Folder {
                path: dir.path().into(),
                reason: format!("`{key}` would mix several {what}; run it in a new folder"),
            });
        }
    }
    Ok(())
}

fn record(fold: &Fold<'_>) -> FoldRecord {
    let RunResult {
        repeat,
        fold: number,
        command,
        git,
        split_sha256,
        recipe_sha256,
        ..
    } = &fold.finished.result;
    FoldRecord {
        repeat: *repeat,
        fold: *number,
        command: command.clone(),
        git: git.clone(),
        split_sha256: split_sha256.clone(),
        recipe_sha256: recipe_sha256.clone(),
        predictions: format!("tasks/{}/{}", fold.finished.task.id, fold.file),
        one_sweep: fold.evaluation.one_sweep.mean,
    }
}

/// What was published for this recipe, asked this way.
fn published(finished: &FinishedTask<'_>, way: PredictionMethod) -> Option<Published> {
    let row = published_for(&finished.config, &finished.split, way)?;
    Some(Published {
        classifier: row.classifier.into(),
        one_sweep: row.one_sweep.0,
        three_sweeps: row.three_sweeps.0,
    })
}

fn confidence(sweep: &SweepScore) -> f64 {
    sweep.log_probability[sweep.predicted()].exp()
}

fn reliability(sweeps: &[&SweepScore]) -> Vec<ReliabilityBin> {
    let mut bins = vec![(0.0, 0, 0); BINS];
    for sweep in sweeps {
        let confidence = confidence(sweep);
        // Bins end on the right, as those of the calibration error.
        let bin = &mut bins[((confidence * BINS as f64).ceil() as usize).clamp(1, BINS) - 1];
        bin.0 += confidence;
        bin.1 += usize::from(sweep.predicted() == sweep.label);
        bin.2 += 1;
    }
    bins.into_iter()
        .filter(|(_, _, count)| *count > 0)
        .map(|(sum, right, count)| ReliabilityBin {
            confidence: sum / count as f64,
            accuracy: right as f64 / count as f64,
            count,
        })
        .collect()
}

fn risk_coverage(sweeps: &[&SweepScore]) -> Vec<RiskCoverage> {
    let mut sorted: Vec<(f64, f64)> = sweeps
        .iter()
        .map(|sweep| {
            let wrong = sweep.predicted() != sweep.label;
            (confidence(sweep), f64::from(u8::from(wrong)))
        })
        .collect();
    sorted.sort_by(|a, b| b.0.total_cmp(&a.0));
    // Sweeps of equal confidence come in any order: each counts their mean error.
    for tie in sorted.chunk_by_mut(|a, b| a.0 == b.0) {
        let mean = tie.iter().map(|(_, wrong)| wrong).sum::<f64>() / tie.len() as f64;
        tie.iter_mut().for_each(|(_, wrong)| *wrong = mean);
    }
    (1..=COVERAGES)
        .map(|point| {
            let answered = (sorted.len() * point).div_ceil(COVERAGES);
            let wrong: f64 = sorted[..answered].iter().map(|(_, wrong)| wrong).sum();
            RiskCoverage {
                coverage: answered as f64 / sorted.len() as f64,
                risk: wrong / answered as f64,
            }
        })
        .collect()
}

/// All pairs of contenders that share data set, levels, steps and split.
fn comparisons(rows: &[Row]) -> Vec<Comparison> {
    let alike = |a: &Row, b: &Row| {
        (&a.data, &a.levels, &a.split, a.steps) == (&b.data, &b.levels, &b.split, b.steps)
    };
    let contenders: Vec<&Row> = rows.iter().filter(|row| !row.probe).collect();
    let mut found = Vec::new();
    for (i, first) in contenders.iter().enumerate() {
        for second in contenders[i + 1..]
            .iter()
            .filter(|second| alike(first, second))
        {
            let differences: Vec<f64> = first
                .folds
                .iter()
                .filter_map(|a| {
                    let b = second
                        .folds
                        .iter()
                        .find(|b| b.split_sha256 == a.split_sha256)?;
                    Some(a.one_sweep - b.one_sweep)
                })
                .collect();
            if differences.is_empty() {
                continue;
            }
            let share = first.n_test as f64 / first.n_train as f64;
            found.push(Comparison {
                first: first.key.clone(),
                second: second.key.clone(),
                difference: differences.iter().sum::<f64>() / differences.len() as f64,
                folds: differences.len(),
                p: if differences.len() > 1 {
                    resampled_t_test(&differences, share)
                } else {
                    None
                },
            });
        }
    }
    found
}
