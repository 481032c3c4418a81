//! The rows of a summary: one measured quantity each.

use serde::{Deserialize, Serialize};
use tactnet_data::DataOrigin;
use tactnet_pipeline::MeanRemoval;

use crate::measure::Measure;
use crate::published_confusion::TACTMAT_MATERIALS;
use crate::statistic::Statistic;

/// One measure of one contender on one data set, as a mean over tasks.
///
/// All draws of new materials come from the same data set, so an interval over draws does not extend to other data
/// sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Unique key within the summary.
    pub key: String,
    /// Key of the contender, shared by its rows of other measures and conditions.
    pub contender: String,
    /// Name of the data set.
    pub data: String,
    /// Origin of the sweeps.
    pub origin: DataOrigin,
    /// Number of materials in the data set.
    pub materials: usize,
    /// Treatment of the mean of each taxel.
    pub levels: MeanRemoval,
    /// Time steps of a sweep.
    pub steps: usize,
    /// Name of the model's recipe.
    pub model: String,
    /// Name of the method, or of the prediction method: `plain`, `mc_dropout`.
    pub method: String,
    /// Condition of the measurement; empty if there is only one.
    pub setting: String,
    /// Support sweeps of each new material.
    pub shots: Option<usize>,
    /// Sweeps for each decision.
    pub sweeps: Option<usize>,
    /// Measured quantity.
    pub measure: Measure,
    /// Mean, standard deviation, interval, and one value for each task, in the measure's unit.
    #[serde(flatten)]
    pub statistic: Statistic,
    /// Number of tasks.
    pub n: usize,
    /// Number of decisions in all tasks.
    pub decisions: usize,
    /// Value published for TactMat, in the same unit.
    pub published: Option<f64>,
    /// Value published for humans on TactMat.
    pub humans: Option<f64>,
    /// Network, condition, accuracy and cost of the row; only for `networks`.
    #[serde(flatten, default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<NetworkCost>,
}

/// A network under one condition of the question `networks`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NetworkCost {
    /// Name of its recipe.
    pub network: String,
    /// The condition.
    pub condition: String,
    /// Mean accuracy of single sweeps; the row holds its interval.
    pub accuracy: f64,
    /// Multiply-adds of one prediction without dropout; only for the standard condition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiply_adds: Option<f64>,
    /// Training time in seconds; only for the standard condition.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub train_seconds: Option<f64>,
}

impl Row {
    /// Returns true for a row of single-sweep accuracy, which ranks the contenders of a cross-validation.
    pub fn is_one_sweep_accuracy(&self) -> bool {
        self.measure == Measure::Accuracy && self.sweeps == Some(1)
    }

    /// Returns true if the row is comparable with published numbers: it covers all materials of TactMat or its twin.
    pub fn is_beside_published(&self) -> bool {
        self.origin.is_comparable_to_published() && self.materials == TACTMAT_MATERIALS.len()
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns a row of two tasks.
    pub(crate) fn row(data: &str, model: &str, method: &str, measure: Measure) -> Row {
        Row {
            key: format!("{data}/{model}, {measure}"),
            contender: format!("{data}/{model}"),
            data: data.into(),
            origin: DataOrigin::Recorded,
            materials: 3,
            levels: MeanRemoval::None,
            steps: 1000,
            model: model.into(),
            method: method.into(),
            setting: String::new(),
            shots: None,
            sweeps: None,
            measure,
            statistic: Statistic::of(vec![0.4, 0.6], 0.25),
            n: 2,
            decisions: 600,
            published: None,
            humans: None,
            cost: None,
        }
    }
}
