//! The contenders of a cross-validation: results of their run directories beyond the rows of the summary.

use std::collections::{BTreeMap, BTreeSet};

use tactnet_data::{Scheme, SplitManifest};
use tactnet_pipeline::{
    ConfoundedAccuracy, Estimate, Evaluation, LengthAccuracy, ModelRecipe, PredictionMethod,
    Predictions, RunConfig, RunDir, RunResult, SplitKind, SweepScore, TrainingSteps,
};

use super::finished::FinishedTask;
use super::training::split_name;
use crate::confidence::{reliability, risk_coverage};
use crate::contender::{Contender, FoldRecord, PublishedContender};
use crate::questions::Crossval;
use crate::summary::Summary;
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, published_for};

/// Number of sweeps for one fused decision, as in the published tables.
const FUSED: usize = 3;

/// One prediction method of one finished task.
struct Fold<'a> {
    finished: &'a FinishedTask<'a>,
    method: PredictionMethod,
    config: RunConfig,
    split: SplitManifest,
    result: RunResult,
    predictions: Predictions,
    file: String,
}

impl Fold<'_> {
    fn evaluation(&self) -> &Evaluation {
        &self.result.evaluations[&self.method]
    }
}

/// Reads the predictions of all tasks and groups them by contender, in the order of the summary's rows.
///
/// # Errors
/// A damaged run directory.
pub(crate) fn contenders(
    dir: &ExperimentDir,
    summary: &Summary,
    finished: &[FinishedTask<'_>],
    asked: &Crossval,
) -> Result<Vec<Contender>, ExperimentError> {
    let mut of: BTreeMap<String, Vec<Fold<'_>>> = BTreeMap::new();
    for finished in finished {
        let run = RunDir::open(&dir.task_dir(finished.task))?;
        let Some(result) = run.result()? else {
            continue;
        };
        let (config, split) = (run.config()?, run.split()?);
        let setting = split_name(&split, &config);
        for &method in result.evaluations.keys() {
            let (file, predictions) = run.predictions(method)?;
            let fold = Fold {
                finished,
                method,
                config: config.clone(),
                split: split.clone(),
                result: result.clone(),
                predictions,
                file,
            };
            of.entry(finished.contender(method.name(), &setting))
                .or_default()
                .push(fold);
        }
    }
    let rows = summary
        .rows
        .iter()
        .filter(|row| row.is_one_sweep_accuracy());
    Ok(rows
        .filter_map(|row| {
            let mut folds = of.remove(&row.contender)?;
            folds.sort_by_key(|fold| fold.finished.record.part);
            Some(contender(
                row.contender.clone(),
                row.statistic.mean,
                &folds,
                asked,
            ))
        })
        .collect())
}

fn contender(key: String, accuracy: f64, folds: &[Fold<'_>], asked: &Crossval) -> Contender {
    let first = &folds[0];
    let materials: Vec<String> = first
        .config
        .classifier
        .labels
        .names()
        .map(String::from)
        .collect();
    let confusion = sum(folds.iter().map(|fold| fold.predictions.confusion()));
    let fused_confusion = sum(folds
        .iter()
        .map(|fold| fold.predictions.fused_confusion(FUSED, fold.result.seed)));
    let sweeps: Vec<&SweepScore> = folds.iter().flat_map(|f| &f.predictions.sweeps).collect();
    let n_test = first.result.n_test;
    Contender {
        key,
        data: first.finished.data_name().into(),
        origin: first.finished.origin,
        model: first.finished.model.clone(),
        levels: first.finished.levels,
        split: folds_text(asked, &first.split, &first.config),
        split_kind: SplitKind::of(first.split.scheme),
        inner: first.config.spec.inner,
        shots: first.config.spec.shots,
        committee: matches!(first.config.recipe, ModelRecipe::Committee(_)),
        own_method: first.config.recipe.method().name() == first.method.name(),
        prediction: first.method,
        steps: first.finished.steps.0,
        training: training(first),
        network: network(first).map(String::from),
        probe: first.finished.task.probe.is_some(),
        sigma_test: (accuracy * (1.0 - accuracy) / n_test as f64).sqrt(),
        n_train: first.result.n_train,
        n_test,
        confounded: confounded(folds, &materials, &confusion),
        confusion,
        by_length: by_length(folds),
        fused_confusion,
        reliability: reliability(&sweeps),
        risk_coverage: risk_coverage(&sweeps),
        published: published(first, first.method),
        folds: folds.iter().map(record).collect(),
        materials,
    }
}

/// Returns the accuracy without the materials that coincide with recording blocks, over all folds.
///
/// - `confusion`: counts of the folds together; its interval counts each sweep once, independent of the number of repeats
fn confounded(
    folds: &[Fold<'_>],
    materials: &[String],
    confusion: &[Vec<usize>],
) -> Option<ConfoundedAccuracy> {
    // Which materials these are depends on the data set alone.
    let found = folds[0].result.confounded.clone()?;
    let repeats: BTreeSet<usize> = folds.iter().map(|fold| fold.result.repeat).collect();
    let count = |names: &[String], of: fn(&[usize], usize) -> usize| -> usize {
        let rows = confusion.iter().zip(materials).enumerate();
        let rows = rows.filter(|(_, (_, material))| names.contains(material));
        rows.map(|(label, (row, _))| of(row, label)).sum()
    };
    let right = count(&found.unconfounded, |row, label| row[label]);
    let [tested, n_confounded] = [&found.unconfounded, &found.confounded]
        .map(|names| count(names, |row, _| row.iter().sum()));
    let sweeps = tested / repeats.len();
    Some(ConfoundedAccuracy {
        n_confounded: n_confounded / repeats.len(),
        unconfounded_one_sweep: (sweeps > 0)
            .then(|| Estimate::wilson(right as f64 / tested as f64, sweeps)),
        ..found
    })
}

/// Returns the accuracy for each quartile of length in its fold, over all folds; empty if a fold has fewer groups than others.
///
/// The intervals count each sweep once, independent of the number of repeats.
fn by_length(folds: &[Fold<'_>]) -> Vec<LengthAccuracy> {
    let of_folds: Vec<&[LengthAccuracy]> = folds
        .iter()
        .map(|fold| fold.evaluation().by_length.as_slice())
        .collect();
    let groups = of_folds[0].len();
    if of_folds.iter().any(|fold| fold.len() != groups) {
        return Vec::new();
    }
    let repeats: BTreeSet<usize> = folds.iter().map(|fold| fold.result.repeat).collect();
    let pooled = |group: usize| {
        let parts = || of_folds.iter().map(|fold| fold[group]);
        let tested: usize = parts().map(|part| part.accuracy.n).sum();
        let right = parts().map(|part| part.accuracy.mean * part.accuracy.n as f64);
        let mean = right.sum::<f64>() / tested as f64;
        LengthAccuracy {
            shortest: parts().map(|part| part.shortest).min().unwrap_or(0),
            longest: parts().map(|part| part.longest).max().unwrap_or(0),
            accuracy: Estimate::wilson(mean, (tested / repeats.len()).max(1)),
        }
    };
    (0..groups).map(pooled).collect()
}

/// Returns the description of a split with the trained folds: "2 of 5 random folds".
fn folds_text(asked: &Crossval, split: &SplitManifest, config: &RunConfig) -> String {
    let whole = split_name(split, config);
    let Scheme::StratifiedKFold { folds, .. } = split.scheme else {
        return whole;
    };
    let part = if asked.folds < folds {
        format!("{} of {whole}", asked.folds)
    } else {
        whole
    };
    match asked.repeats {
        0 | 1 => part,
        repeats => format!("{part}, {repeats} times"),
    }
}

/// Returns the sum of matrices of the same size.
fn sum(matrices: impl Iterator<Item = Vec<Vec<usize>>>) -> Vec<Vec<usize>> {
    let add = |mut sum: Vec<Vec<usize>>, other: Vec<Vec<usize>>| {
        let entries = sum.iter_mut().flatten().zip(other.into_iter().flatten());
        entries.for_each(|(sum, count)| *sum += count);
        sum
    };
    matrices.reduce(add).unwrap_or_default()
}

/// Returns the display name of the kind of network.
fn network(fold: &Fold<'_>) -> Option<&'static str> {
    match &fold.config.recipe {
        ModelRecipe::Network(recipe) => Some(recipe.network.kind()),
        ModelRecipe::Baseline(_) | ModelRecipe::Committee(_) => None,
    }
}

/// Returns epochs and batches of a network's training.
fn training(fold: &Fold<'_>) -> Option<TrainingSteps> {
    let ModelRecipe::Network(recipe) = &fold.config.recipe else {
        return None;
    };
    Some(TrainingSteps::of(&recipe.training, fold.result.n_train))
}

fn record(fold: &Fold<'_>) -> FoldRecord {
    let id = &fold.finished.task.id;
    FoldRecord {
        task: id.clone(),
        repeat: fold.result.repeat,
        fold: fold.result.fold,
        predictions: format!("tasks/{id}/{}", fold.file),
        one_sweep: fold.evaluation().one_sweep.mean,
    }
}

/// Returns the accuracy published for this recipe and prediction method.
fn published(fold: &Fold<'_>, way: PredictionMethod) -> Option<PublishedContender> {
    let row = published_for(&fold.config, fold.result.origin, &fold.split, way)?;
    Some(PublishedContender {
        classifier: row.classifier.into(),
        one_sweep: row.one_sweep.0,
        three_sweeps: row.three_sweeps.0,
    })
}
