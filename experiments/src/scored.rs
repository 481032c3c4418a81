//! A contender joined with its rows, for audits, groups and reports.

use std::collections::BTreeSet;
use std::ops::Deref;

use tactnet_pipeline::{PredictionMethod, TrainingSteps};

use crate::contender::Contender;
use crate::measure::Measure;
use crate::statistic::Statistic;
use crate::summary::Summary;

/// A contender joined with its rows.
#[derive(Debug, Clone, Copy)]
pub struct Scored<'a> {
    /// The contender, whose fields this type forwards.
    pub contender: &'a Contender,
    /// Accuracy of single sweeps.
    pub one_sweep: &'a Statistic,
    /// Balanced accuracy of single sweeps; absent in results of earlier versions.
    pub balanced: Option<&'a Statistic>,
    /// Accuracy of three fused sweeps.
    pub three_sweeps: Option<&'a Statistic>,
    /// Majority vote of three sweeps; absent in results of earlier builds.
    pub three_votes: Option<&'a Statistic>,
    /// Negative log-likelihood of single sweeps, in nats.
    pub negative_log_likelihood: &'a Statistic,
    /// Expected calibration error of single sweeps, 0 to 1.
    pub expected_calibration_error: &'a Statistic,
    /// Brier score of single sweeps, 0 to 2.
    pub brier: &'a Statistic,
    /// Training time, in seconds.
    pub train_seconds: &'a Statistic,
}

impl Deref for Scored<'_> {
    type Target = Contender;

    fn deref(&self) -> &Contender {
        self.contender
    }
}

/// A network with few training steps.
#[derive(Debug, Clone, PartialEq)]
pub struct FewSteps {
    /// Display name of the model.
    pub model: String,
    /// Name of the data set.
    pub data: String,
    /// Epochs and batches of its training.
    pub steps: TrainingSteps,
}

impl Scored<'_> {
    /// Returns the display name of the model; for a network with its kind, such as `TactNet-II (fast)`.
    pub fn model_name(&self) -> String {
        match &self.network {
            Some(kind) => format!("{kind} ({})", self.model),
            None => self.model.clone(),
        }
    }

    /// Returns the display name of model and prediction method.
    pub fn name(&self) -> String {
        match self.prediction {
            PredictionMethod::Plain => self.model_name(),
            PredictionMethod::McDropout { .. } => format!("{}, MC dropout", self.model_name()),
        }
    }

    /// Returns the length of the training if it is a network with few training steps.
    pub(crate) fn few_steps(&self) -> Option<TrainingSteps> {
        self.training
            .filter(|training| training.are_few() && self.shots.is_none())
    }

    /// Returns the accuracy of always naming the material with the most test sweeps.
    pub fn guessing(&self) -> f64 {
        let sweeps = self.confusion.iter().map(|row| row.iter().sum::<usize>());
        let most = sweeps.clone().max().unwrap_or(0);
        most as f64 / sweeps.sum::<usize>().max(1) as f64
    }

    /// Returns true if materials have unequal numbers of test sweeps, so that balanced accuracy differs from accuracy.
    pub fn is_unbalanced(&self) -> bool {
        let mut sweeps = self.confusion.iter().map(|row| row.iter().sum::<usize>());
        sweeps
            .next()
            .is_some_and(|first| sweeps.any(|other| other != first))
    }

    /// Returns the number of repeats, which is how often each sweep was tested.
    pub(crate) fn repeats(&self) -> usize {
        let repeats: BTreeSet<usize> = self.folds.iter().map(|fold| fold.repeat).collect();
        repeats.len().max(1)
    }
}

/// Returns the networks with few training steps, each once.
pub(crate) fn few_steps(contenders: &[Scored<'_>]) -> Vec<FewSteps> {
    let mut found: Vec<FewSteps> = Vec::new();
    for row in contenders {
        let Some(steps) = row.few_steps() else {
            continue;
        };
        let few = FewSteps {
            model: row.model_name(),
            data: row.data.clone(),
            steps,
        };
        if !found.contains(&few) {
            found.push(few);
        }
    }
    found
}

impl Summary {
    /// Returns all contenders of a cross-validation with their rows, in the order of the summary. Contenders with
    /// missing rows are left out.
    pub fn scored(&self) -> Vec<Scored<'_>> {
        self.contenders
            .iter()
            .filter_map(|contender| self.with_rows(contender))
            .collect()
    }

    /// Returns the networks of a cross-validation with few training steps, each once.
    pub fn few_steps(&self) -> Vec<FewSteps> {
        few_steps(&self.scored())
    }

    fn with_rows<'a>(&'a self, contender: &'a Contender) -> Option<Scored<'a>> {
        let statistic = |measure: Measure, sweeps: usize| {
            let own = self.rows.iter().find(|row| {
                row.contender == contender.key
                    && row.measure == measure
                    && row.sweeps == Some(sweeps)
            });
            own.map(|row| &row.statistic)
        };
        Some(Scored {
            contender,
            one_sweep: statistic(Measure::Accuracy, 1)?,
            balanced: statistic(Measure::BalancedAccuracy, 1),
            three_sweeps: statistic(Measure::Accuracy, 3),
            three_votes: statistic(Measure::VoteAccuracy, 3),
            negative_log_likelihood: statistic(Measure::NegativeLogLikelihood, 1)?,
            expected_calibration_error: statistic(Measure::ExpectedCalibrationError, 1)?,
            brier: statistic(Measure::Brier, 1)?,
            train_seconds: statistic(Measure::TrainSeconds, 1)?,
        })
    }
}
