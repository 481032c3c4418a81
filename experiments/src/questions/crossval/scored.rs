//! A contender joined with its rows, for audits, groups and reports.

use tactnet_data::DataOrigin;
use tactnet_pipeline::{MeanRemoval, PredictionMethod, SplitKind, TrainingSteps};

use super::{Contender, FoldRecord, PublishedContender, ReliabilityBin, RiskCoverage};
use crate::{Measure, Statistic, Summary};

/// A contender joined with its rows.
pub(crate) struct Scored<'a> {
    pub(crate) key: &'a str,
    pub(crate) data: &'a str,
    pub(crate) origin: DataOrigin,
    pub(crate) model: &'a str,
    pub(crate) levels: MeanRemoval,
    pub(crate) split: &'a str,
    pub(crate) split_kind: SplitKind,
    pub(crate) inner: Option<usize>,
    pub(crate) prediction: PredictionMethod,
    pub(crate) steps: usize,
    pub(crate) training: Option<TrainingSteps>,
    /// Display name of the kind of network.
    pub(crate) network: Option<&'a str>,
    pub(crate) probe: bool,
    pub(crate) materials: &'a [String],
    pub(crate) one_sweep: &'a Statistic,
    pub(crate) three_sweeps: Option<&'a Statistic>,
    /// Majority vote of three sweeps; absent in results of earlier builds.
    pub(crate) three_votes: Option<&'a Statistic>,
    pub(crate) sigma_test: f64,
    pub(crate) negative_log_likelihood: &'a Statistic,
    pub(crate) expected_calibration_error: &'a Statistic,
    pub(crate) brier: &'a Statistic,
    pub(crate) train_seconds: &'a Statistic,
    pub(crate) n_train: usize,
    pub(crate) n_test: usize,
    pub(crate) confusion: &'a [Vec<usize>],
    pub(crate) fused_confusion: &'a [Vec<usize>],
    pub(crate) reliability: &'a [ReliabilityBin],
    pub(crate) risk_coverage: &'a [RiskCoverage],
    pub(crate) published: Option<&'a PublishedContender>,
    pub(crate) folds: &'a [FoldRecord],
}

impl Scored<'_> {
    /// Returns the display name of the model; for a network with its kind, such as `TactNet-II (fast)`.
    pub(crate) fn model_name(&self) -> String {
        match self.network {
            Some(kind) => format!("{kind} ({})", self.model),
            None => self.model.to_string(),
        }
    }

    /// Returns the display name of model and prediction method.
    pub(crate) fn name(&self) -> String {
        match self.prediction {
            PredictionMethod::Plain => self.model_name(),
            PredictionMethod::McDropout { .. } => format!("{}, MC dropout", self.model_name()),
        }
    }

    /// Returns the length of the training if it is a network with few training steps.
    pub(crate) fn few_steps(&self) -> Option<TrainingSteps> {
        self.training.filter(|training| training.are_few())
    }

    /// Returns the number of repeats, which is how often each sweep was tested.
    pub(crate) fn repeats(&self) -> usize {
        let repeats: std::collections::BTreeSet<usize> =
            self.folds.iter().map(|fold| fold.repeat).collect();
        repeats.len().max(1)
    }
}

/// Returns a hint for each network with few training steps.
pub(crate) fn few_steps(contenders: &[Scored<'_>]) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for row in contenders {
        let hint = row
            .few_steps()
            .and_then(|steps| steps.hint("--set epochs="))
            .map(|hint| format!("{hint}; name another folder with `--out`"));
        if let Some(hint) = hint {
            let line = format!("{} on {}: {hint}", row.model_name(), row.data);
            if !lines.contains(&line) {
                lines.push(line);
            }
        }
    }
    lines
}

/// Returns all contenders of a cross-validation with their rows, in the order of the summary.
pub(crate) fn scored(summary: &Summary) -> Vec<Scored<'_>> {
    let contenders = summary.contenders.iter();
    contenders
        .filter_map(|contender| with_rows(summary, contender))
        .collect()
}

/// Returns a contender with its rows; `None` if one is missing.
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
        prediction: contender.prediction,
        steps: contender.steps,
        training: contender.training,
        network: contender.network.as_deref(),
        probe: contender.probe,
        materials: &contender.materials,
        one_sweep: statistic(Measure::Accuracy, 1)?,
        three_sweeps: statistic(Measure::Accuracy, 3),
        three_votes: statistic(Measure::VoteAccuracy, 3),
        sigma_test: contender.sigma_test,
        negative_log_likelihood: statistic(Measure::NegativeLogLikelihood, 1)?,
        expected_calibration_error: statistic(Measure::ExpectedCalibrationError, 1)?,
        brier: statistic(Measure::Brier, 1)?,
        train_seconds: statistic(Measure::TrainSeconds, 1)?,
        n_train: contender.n_train,
        n_test: contender.n_test,
        confusion: &contender.confusion,
        fused_confusion: &contender.fused_confusion,
        reliability: &contender.reliability,
        risk_coverage: &contender.risk_coverage,
        published: contender.published.as_ref(),
        folds: &contender.folds,
    })
}
