//! The contenders of a cross-validation: results of their run directories beyond the rows of the summary.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize, Serializer};
use tactnet_data::{DataOrigin, SplitManifest};
use tactnet_pipeline::{
    Evaluation, MeanRemoval, ModelRecipe, PredictionMethod, Predictions, RunConfig, RunDir,
    RunResult, SplitKind, SweepScore, TrainingSteps,
};

use super::Crossval;
use super::confidence::{ReliabilityBin, RiskCoverage, reliability, risk_coverage};
use super::training::split_name;
use crate::summarise::{FinishedTask, is_one_sweep_accuracy};
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Summary, published_for};

/// Number of sweeps for one fused decision, as in the published tables.
const FUSED: usize = 3;

/// One classifier on one data set with one prediction method, without its rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contender {
    /// The `contender` of its rows.
    pub key: String,
    /// Name of the data set.
    pub data: String,
    /// Origin of the sweeps.
    pub origin: DataOrigin,
    /// Name of the model's recipe.
    pub model: String,
    /// Treatment of the mean of each taxel.
    pub levels: MeanRemoval,
    /// Description of the split.
    pub split: String,
    /// Kind of split.
    pub split_kind: SplitKind,
    /// Part of the training sweeps that was evaluated instead of the test sweeps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inner: Option<usize>,
    /// Prediction method, written by its name in files.
    #[serde(serialize_with = "by_name")]
    pub prediction: PredictionMethod,
    /// Time steps of a sweep.
    pub steps: usize,
    /// Length of a network's training in each fold; absent for baselines.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingSteps>,
    /// Display name of the kind of network; absent for baselines.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub network: Option<String>,
    /// True for a probe (means, permuted labels).
    pub probe: bool,
    /// Materials in label order.
    pub materials: Vec<String>,
    /// Training sweeps of a fold.
    pub n_train: usize,
    /// Test sweeps of a fold.
    pub n_test: usize,
    /// Standard deviation of one fold's accuracy due to its finite number of test sweeps alone: `sqrt(a (1 - a) / n)`.
    pub sigma_test: f64,
    /// Counts `[true][predicted]`, summed over folds.
    pub confusion: Vec<Vec<usize>>,
    /// Counts `[true][predicted]` of three fused sweeps, with each sweep in 20 groups, summed over folds.
    #[serde(skip)]
    pub fused_confusion: Vec<Vec<usize>>,
    /// Fifteen equally wide bins of confidence.
    pub reliability: Vec<ReliabilityBin>,
    /// Error among the most confident share of the sweeps, over all folds.
    pub risk_coverage: Vec<RiskCoverage>,
    /// The comparable published accuracy.
    pub published: Option<PublishedContender>,
    /// Folds in the order of the rows' values.
    pub folds: Vec<FoldRecord>,
}

fn by_name<S: Serializer>(method: &PredictionMethod, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(method.name())
}

/// A published accuracy on TactMat, in %.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PublishedContender {
    /// Name of the published classifier.
    pub classifier: String,
    /// Accuracy with one sweep.
    pub one_sweep: f64,
    /// Accuracy with three sweeps.
    pub three_sweeps: f64,
}

/// One fold of a contender; its task is among the summary's records.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FoldRecord {
    /// Name of the task.
    pub task: String,
    /// Repeat of the cross-validation.
    pub repeat: usize,
    /// Fold of the repeat.
    pub fold: usize,
    /// Predictions file, relative to the experiment's folder.
    pub predictions: String,
    /// Accuracy of single sweeps.
    pub one_sweep: f64,
}

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
    let rows = summary.rows.iter().filter(|row| is_one_sweep_accuracy(row));
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
        split: asked.folds_text(&first.split, &first.config),
        split_kind: SplitKind::of(first.split.scheme),
        inner: first.config.spec.inner,
        prediction: first.method,
        steps: first.finished.steps.0,
        training: training(first),
        network: network(first).map(String::from),
        probe: first.finished.task.probe.is_some(),
        sigma_test: (accuracy * (1.0 - accuracy) / n_test as f64).sqrt(),
        n_train: first.result.n_train,
        n_test,
        confusion,
        fused_confusion,
        reliability: reliability(&sweeps),
        risk_coverage: risk_coverage(&sweeps),
        published: published(first, first.method),
        folds: folds.iter().map(record).collect(),
        materials,
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
        ModelRecipe::Baseline(_) => None,
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
