//! The contenders of a cross-validation: what their run directories hold besides the rows of the summary.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::{DataOrigin, SplitManifest};
use tactnet_pipeline::{
    Evaluation, MeanRemoval, PredictionMethod, Predictions, RunConfig, RunDir, RunResult,
    SplitKind, SweepScore,
};

use crate::summarise::{FinishedTask, is_one_sweep_accuracy};
use crate::tasks::ExperimentDir;
use crate::{
    ExperimentError, Measure, Measurement, Part, Statistic, Summary, Task, TaskRecord,
    published_for,
};

/// Bins of the reliability diagram.
const BINS: usize = 15;
/// Points of the risk-coverage curve.
const COVERAGES: usize = 50;

/// One classifier on one data set, asked one way: everything but its rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contender {
    /// The `contender` of its rows.
    pub key: String,
    /// Name of the data set.
    pub data: String,
    /// Where its sweeps come from.
    pub origin: DataOrigin,
    /// Name of the model's recipe.
    pub model: String,
    /// What happens to the mean of every taxel.
    pub levels: MeanRemoval,
    /// How the data set was split, for people.
    pub split: String,
    /// How the data set was split.
    pub split_kind: SplitKind,
    /// Part of the training sweeps that was tested on instead of the test sweeps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inner: Option<usize>,
    /// `plain` or `mc_dropout`.
    pub prediction: String,
    /// Time steps of a sweep.
    pub steps: usize,
    /// True for a probe (means, permuted labels).
    pub probe: bool,
    /// Materials in label order.
    pub materials: Vec<String>,
    /// Training sweeps of a fold.
    pub n_train: usize,
    /// Test sweeps of a fold.
    pub n_test: usize,
    /// Standard deviation of one fold's accuracy that its finite number of test sweeps alone explains: `sqrt(a (1 - a) / n)`.
    pub sigma_test: f64,
    /// Counts `[true][predicted]`, all folds together.
    pub confusion: Vec<Vec<usize>>,
    /// Fifteen equally wide bins of confidence.
    pub reliability: Vec<ReliabilityBin>,
    /// Error among the most confident share of the sweeps, all folds together.
    pub risk_coverage: Vec<RiskCoverage>,
    /// What was published beside it, if anything was.
    pub published: Option<PublishedContender>,
    /// Folds in the order of the rows' values.
    pub folds: Vec<FoldRecord>,
}

/// One bin of a reliability diagram.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    /// Mean confidence, 0 to 1.
    pub confidence: f64,
    /// Share that was right, 0 to 1.
    pub accuracy: f64,
    /// Sweeps in the bin; bins without any are left out.
    pub count: usize,
}

/// One point of a risk-coverage curve.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RiskCoverage {
    /// Share of the sweeps that are answered, most confident first.
    pub coverage: f64,
    /// Share of the answers that are wrong.
    pub risk: f64,
}

/// A published accuracy on TactMat, %.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PublishedContender {
    /// What it was published for.
    pub classifier: String,
    /// One sweep.
    pub one_sweep: f64,
    /// Three sweeps.
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

/// A contender with its rows.
pub(crate) struct Scored<'a> {
    pub(crate) key: &'a str,
    pub(crate) data: &'a str,
    pub(crate) origin: DataOrigin,
    pub(crate) model: &'a str,
    pub(crate) levels: MeanRemoval,
    pub(crate) split: &'a str,
    pub(crate) split_kind: SplitKind,
    pub(crate) inner: Option<usize>,
    pub(crate) prediction: &'a str,
    pub(crate) steps: usize,
    pub(crate) probe: bool,
    pub(crate) materials: &'a [String],
    pub(crate) one_sweep: &'a Statistic,
    pub(crate) three_sweeps: Option<&'a Statistic>,
    pub(crate) sigma_test: f64,
    pub(crate) negative_log_likelihood: &'a Statistic,
    pub(crate) expected_calibration_error: &'a Statistic,
    pub(crate) brier: &'a Statistic,
    pub(crate) train_seconds: &'a Statistic,
    pub(crate) n_train: usize,
    pub(crate) n_test: usize,
    pub(crate) confusion: &'a [Vec<usize>],
    pub(crate) reliability: &'a [ReliabilityBin],
    pub(crate) risk_coverage: &'a [RiskCoverage],
    pub(crate) published: Option<&'a PublishedContender>,
    pub(crate) folds: &'a [FoldRecord],
}

impl Scored<'_> {
    /// Repeats of the cross-validation: how often every sweep was tested.
    pub(crate) fn repeats(&self) -> usize {
        let repeats: std::collections::BTreeSet<usize> =
            self.folds.iter().map(|fold| fold.repeat).collect();
        repeats.len().max(1)
    }
}

/// Every contender of a cross-validation with its rows, in the order of the summary.
pub(crate) fn scored(summary: &Summary) -> Vec<Scored<'_>> {
    let contenders = summary.contenders.iter();
    contenders
        .filter_map(|contender| with_rows(summary, contender))
        .collect()
}

/// A contender with its rows; `None` if one is missing.
fn with_rows<'a>(summary: &'a Summary, contender: &'a Contender) -> Option<Scored<'a>> {
    let statistic = |measure: Measure, sweeps: usize| {
        let own = summary.rows.iter().find(|row| {
            row.contender == contender.key && row.measure == measure && row.sweeps == Some(sweeps)
        });
        own.map(|row| &row.statistic)
    };
    Some(Scored {
        key: &contender.key,
        data: &contender.data,
        origin: contender.origin,
        model: &contender.model,
        levels: contender.levels,
        split: &contender.split,
        split_kind: contender.split_kind,
        inner: contender.inner,
        prediction: &contender.prediction,
        steps: contender.steps,
        probe: contender.probe,
        materials: &contender.materials,
        one_sweep: statistic(Measure::Accuracy, 1)?,
        three_sweeps: statistic(Measure::Accuracy, 3),
        sigma_test: contender.sigma_test,
        negative_log_likelihood: statistic(Measure::NegativeLogLikelihood, 1)?,
        expected_calibration_error: statistic(Measure::ExpectedCalibrationError, 1)?,
        brier: statistic(Measure::Brier, 1)?,
        train_seconds: statistic(Measure::TrainSeconds, 1)?,
        n_train: contender.n_train,
        n_test: contender.n_test,
        confusion: &contender.confusion,
        reliability: &contender.reliability,
        risk_coverage: &contender.risk_coverage,
        published: contender.published.as_ref(),
        folds: &contender.folds,
    })
}

/// Reads the run directory of a training that has ended.
///
/// # Errors
/// A run directory that is damaged.
pub(crate) fn read_training<'a>(
    dir: &'a ExperimentDir,
    task: &'a Task,
) -> Result<FinishedTask<'a>, ExperimentError> {
    let path = dir.task_dir(task);
    let run = RunDir::open(&path)?;
    let result = run.result()?.ok_or_else(|| ExperimentError::Folder {
        path: path.clone(),
        reason: "expected a result.json, found none".into(),
    })?;
    let (config, split) = (run.config()?, run.split()?);
    let setting = split_name(&split, &config);
    let mut measurements = Vec::new();
    for (way, evaluation) in &result.evaluations {
        measurements.extend(measured(way, &setting, evaluation, &result));
    }
    Ok(FinishedTask {
        task,
        model: shown_model(&task.model, &result.recipe),
        data: result.data,
        label_order: config.label_order,
        origin: result.origin,
        data_sha256: result.data_sha256,
        materials: config.classifier.labels.len(),
        levels: config.recipe.levels(),
        steps: (config.classifier.shape.steps, config.steps),
        processors: result
            .provenance
            .iter()
            .map(|session| session.processor.clone())
            .collect(),
        test_share: result.n_test as f64 / result.n_train as f64,
        measurements,
        maps: Vec::new(),
        record: TaskRecord {
            id: task.id.clone(),
            part: Part::Fold {
                repeat: result.repeat,
                fold: result.fold,
            },
            command: result.command,
            split: result.split,
            split_sha256: result.split_sha256,
            recipe_sha256: result.recipe_sha256,
            git: result.git,
            seconds: result.train_seconds,
            chosen: result.chosen,
        },
    })
}

/// What one way of predicting measured.
fn measured(
    way: &str,
    setting: &str,
    evaluation: &Evaluation,
    result: &RunResult,
) -> Vec<Measurement> {
    let mut values = vec![(Measure::Accuracy, 1, evaluation.one_sweep.mean)];
    if let Some(fused) = &evaluation.fused {
        values.push((Measure::Accuracy, fused.sweeps, fused.bayes.mean));
    }
    values.extend([
        (
            Measure::NegativeLogLikelihood,
            1,
            evaluation.negative_log_likelihood,
        ),
        (
            Measure::ExpectedCalibrationError,
            1,
            evaluation.expected_calibration_error,
        ),
        (Measure::Brier, 1, evaluation.brier),
        (Measure::TrainSeconds, 1, result.train_seconds),
    ]);
    values
        .into_iter()
        .map(|(measure, sweeps, value)| {
            Measurement::new(measure, way, value, result.n_test)
                .setting(setting)
                .sweeps(sweeps)
        })
        .collect()
}

/// The model's name; a recipe that says more about itself (drawn settings) says it here.
fn shown_model(name: &str, title: &str) -> String {
    if title.starts_with(name) {
        title.into()
    } else {
        name.into()
    }
}

fn split_name(split: &SplitManifest, config: &RunConfig) -> String {
    let scheme = match split.scheme {
        tactnet_data::Scheme::StratifiedKFold { folds, .. } => format!("{folds} random folds"),
        tactnet_data::Scheme::TestFlag => "author's test sweeps".into(),
        tactnet_data::Scheme::LeaveBlockOut => "block left out".into(),
    };
    match config.inner {
        None => scheme,
        Some(part) => format!("{scheme}, judged by inner part {part}"),
    }
}

/// One way of predicting of one finished task.
struct Fold<'a> {
    finished: &'a FinishedTask<'a>,
    way: String,
    config: RunConfig,
    split: SplitManifest,
    result: RunResult,
    predictions: Predictions,
    file: String,
}

impl Fold<'_> {
    fn evaluation(&self) -> &Evaluation {
        &self.result.evaluations[&self.way]
    }
}

/// Reads the predictions of every task, contender by contender, in the order of the summary's rows.
///
/// # Errors
/// A run directory that is damaged.
pub(crate) fn contenders(
    dir: &ExperimentDir,
    summary: &Summary,
    finished: &[FinishedTask<'_>],
) -> Result<Vec<Contender>, ExperimentError> {
    let mut of: BTreeMap<String, Vec<Fold<'_>>> = BTreeMap::new();
    for finished in finished {
        let run = RunDir::open(&dir.task_dir(finished.task))?;
        let Some(result) = run.result()? else {
            continue;
        };
        let (config, split) = (run.config()?, run.split()?);
        let setting = split_name(&split, &config);
        for way in result.evaluations.keys() {
            let (file, predictions) = run.predictions(way)?;
            let fold = Fold {
                finished,
                way: way.clone(),
                config: config.clone(),
                split: split.clone(),
                result: result.clone(),
                predictions,
                file,
            };
            of.entry(finished.contender(way, &setting))
                .or_default()
                .push(fold);
        }
    }
    let rows = summary.rows.iter().filter(|row| is_one_sweep_accuracy(row));
    Ok(rows
        .filter_map(|row| {
            let mut folds = of.remove(&row.contender)?;
            folds.sort_by_key(|fold| fold.finished.record.part);
            Some(contender(row.contender.clone(), row.statistic.mean, &folds))
        })
        .collect())
}

fn contender(key: String, accuracy: f64, folds: &[Fold<'_>]) -> Contender {
    let first = &folds[0];
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
    let n_test = first.result.n_test;
    Contender {
        key,
        data: first.finished.data_name().into(),
        origin: first.finished.origin,
        model: first.finished.model.clone(),
        levels: first.finished.levels,
        split: split_name(&first.split, &first.config),
        split_kind: SplitKind::of(first.split.scheme),
        inner: first.config.inner,
        prediction: first.way.clone(),
        steps: first.finished.steps.0,
        probe: first.finished.task.probe.is_some(),
        sigma_test: (accuracy * (1.0 - accuracy) / n_test as f64).sqrt(),
        n_train: first.result.n_train,
        n_test,
        confusion,
        reliability: reliability(&sweeps),
        risk_coverage: risk_coverage(&sweeps),
        published: published(first, first.evaluation().method),
        folds: folds.iter().map(record).collect(),
        materials,
    }
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

/// What was published for this recipe, asked this way.
fn published(fold: &Fold<'_>, way: PredictionMethod) -> Option<PublishedContender> {
    let row = published_for(&fold.config, fold.result.origin, &fold.split, way)?;
    Some(PublishedContender {
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
