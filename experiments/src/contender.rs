//! The contenders of a cross-validation, beyond the rows of the summary.

use serde::{Deserialize, Serialize, Serializer};
use tactnet_data::DataOrigin;
use tactnet_pipeline::{
    ConfoundedAccuracy, LengthAccuracy, MeanRemoval, PredictionMethod, SplitKind, TrainingSteps,
};

use crate::confidence::{ReliabilityBin, RiskCoverage};

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
    /// Number of training sweeps of each material, drawn from the fold's; absent for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shots: Option<usize>,
    /// True for a committee.
    #[serde(skip_serializing_if = "is_false")]
    pub committee: bool,
    /// True if the prediction method is that of the model's recipe.
    pub own_method: bool,
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
    /// Accuracy without the materials that coincide with recording blocks, over all folds; absent if there are none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub confounded: Option<ConfoundedAccuracy>,
    /// Accuracy for each quartile of length, over all folds; empty if all sweeps have one length.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub by_length: Vec<LengthAccuracy>,
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

fn is_false(value: &bool) -> bool {
    !value
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
