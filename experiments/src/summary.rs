//! The results of an experiment: the numbers of the report.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::DataOrigin;
use tactnet_pipeline::MeanRemoval;

use crate::published_confusion::TACTMAT_MATERIALS;
use crate::{
    Audit, Comparison, Contender, FeatureMap, Grouping, Measure, Part, Question, SampleEfficiency,
    Statistic,
};

/// All results of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Version of this layout, [`Summary::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name of the recipe.
    pub name: String,
    /// One-line title.
    pub title: String,
    /// Result that the recipe's author expects; empty if it refers to other models, data or questions than those of
    /// the run.
    pub expects: String,
    /// Command that repeats the experiment.
    pub command: String,
    /// The question with its fields.
    pub question: Question,
    /// Commits of the programs that ran the tasks.
    pub git: Vec<String>,
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of finished tasks.
    pub tasks_done: usize,
    /// Number of all tasks.
    pub tasks: usize,
    /// Total time of all tasks, in seconds; only the training time for tasks that are single trainings.
    pub train_seconds: f64,
    /// Processor models.
    pub processors: Vec<String>,
    /// Data sets by name, including their treatment.
    pub data: BTreeMap<String, DataRecord>,
    /// One entry for each data set, contender, condition and measure.
    pub rows: Vec<Row>,
    /// Paired comparisons of rows on the same tasks.
    pub comparisons: Vec<Comparison>,
    /// The tasks.
    pub records: Vec<TaskRecord>,
    /// Details of the contenders; only for a cross-validation.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contenders: Vec<Contender>,
    /// Probes of each data set; only for a cross-validation.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub audits: Vec<Audit>,
    /// Groups of materials by contender (see [`Contender::key`]); only for a cross-validation.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, Grouping>,
    /// Sweeps that transfer saves; only for `nshot`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_efficiency: Option<Vec<SampleEfficiency>>,
    /// Two-dimensional embeddings of sweeps; only for `feature-maps`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<FeatureMap>,
}

impl Summary {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 3;

    /// Returns the row with this key.
    pub fn row(&self, key: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.key == key)
    }
}

/// A data set of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataRecord {
    /// SHA-256 of its content.
    pub sha256: String,
    /// Origin of the sweeps.
    pub origin: DataOrigin,
    /// Assumed sample rate, in Hz; absent if the data set states its rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_rate_hz: Option<f64>,
}

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
    /// Returns true if the row is comparable with published numbers: it covers all materials of TactMat or its twin.
    pub fn is_beside_published(&self) -> bool {
        self.origin.is_comparable_to_published() && self.materials == TACTMAT_MATERIALS.len()
    }
}

/// Provenance of one task's numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TaskRecord {
    /// Name of its folder.
    pub id: String,
    /// The part of the data set.
    pub part: Part,
    /// Command that repeats the task; empty unless it is a single training.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub command: String,
    /// Description of the split.
    pub split: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// SHA-256 of the recipe.
    pub recipe_sha256: String,
    /// Commits of the program; several if another build resumed the task.
    pub git: Vec<String>,
    /// Duration of the task, in seconds.
    pub seconds: f64,
    /// Settings that the task selected, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub chosen: BTreeMap<String, f64>,
}
