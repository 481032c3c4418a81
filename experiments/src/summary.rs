//! What an experiment found, made from what its tasks left: the numbers behind the report.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_data::DataOrigin;
use tactnet_pipeline::MeanRemoval;

use crate::published_confusion::TACTMAT_MATERIALS;
use crate::{
    Audit, Comparison, Contender, FeatureMap, Grouping, Measure, Part, Question, SampleEfficiency,
    Statistic,
};

/// Everything an experiment found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Version of this layout, [`Summary::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// Name of the recipe.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// The result that the recipe's author expects; empty where the words speak of models, data or questions that were not run.
    pub expects: String,
    /// The call that leads here.
    pub command: String,
    /// The question with its fields.
    pub question: Question,
    /// Commits of the programs that ran the tasks.
    pub git: Vec<String>,
    /// Names every random choice.
    pub seed: u64,
    /// Tasks that have ended.
    pub tasks_done: usize,
    /// Tasks there are.
    pub tasks: usize,
    /// Time of all tasks together, of trainings alone where a task is one training, seconds.
    pub train_seconds: f64,
    /// Processor models that were used.
    pub processors: Vec<String>,
    /// Data sets by name, with what was done to them.
    pub data: BTreeMap<String, DataRecord>,
    /// One entry for each data set, contender, circumstance and measure.
    pub rows: Vec<Row>,
    /// Pairs of rows on the same tasks.
    pub comparisons: Vec<Comparison>,
    /// The tasks behind the numbers.
    pub records: Vec<TaskRecord>,
    /// Of a cross-validation: what is known of every contender besides its rows.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub contenders: Vec<Contender>,
    /// Of a cross-validation: what each data set gives away.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub audits: Vec<Audit>,
    /// Of a cross-validation: materials in groups, by contender (see [`Contender::key`]).
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub groups: BTreeMap<String, Grouping>,
    /// Of `nshot`: how many more sweeps a network without pre-knowledge needs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample_efficiency: Option<Vec<SampleEfficiency>>,
    /// Of `feature-maps`: sweeps in a plane.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<FeatureMap>,
}

impl Summary {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 3;

    /// Returns the row of a key.
    pub fn row(&self, key: &str) -> Option<&Row> {
        self.rows.iter().find(|row| row.key == key)
    }
}

/// A data set of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataRecord {
    /// SHA-256 of its content.
    pub sha256: String,
    /// Where its sweeps come from.
    pub origin: DataOrigin,
    /// Rate that stands in for one that nobody named, Hz; absent where the data set says its rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_rate_hz: Option<f64>,
}

/// One quantity: a measure of one contender on one data set, mean over tasks.
///
/// Draws of new materials come from one and the same data set, so an interval over draws says nothing about other data sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Unique within the summary.
    pub key: String,
    /// Key of the contender, which its rows of other measures and circumstances share.
    pub contender: String,
    /// Name of the data set.
    pub data: String,
    /// Where its sweeps come from.
    pub origin: DataOrigin,
    /// Materials of the data set.
    pub materials: usize,
    /// Treatment of the mean of every taxel.
    pub levels: MeanRemoval,
    /// Time steps of a sweep.
    pub steps: usize,
    /// Name of the model's recipe.
    pub model: String,
    /// By which method, or how a classifier was asked: `plain`, `mc_dropout`.
    pub method: String,
    /// Under which circumstances; empty where there is only one.
    pub setting: String,
    /// Sweeps of every new material that were learnt from.
    pub shots: Option<usize>,
    /// Sweeps behind one decision.
    pub sweeps: Option<usize>,
    /// The quantity.
    pub measure: Measure,
    /// Mean, deviation and interval, and one value for each task; in the measure's unit.
    #[serde(flatten)]
    pub statistic: Statistic,
    /// Tasks.
    pub n: usize,
    /// Decisions behind it, all tasks together.
    pub decisions: usize,
    /// Published for TactMat, in the same unit.
    pub published: Option<f64>,
    /// Reached by humans on TactMat, as published.
    pub humans: Option<f64>,
    /// Of `networks`: the row's network, circumstance and accuracy by these names, and what the network costs.
    #[serde(flatten, default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<NetworkCost>,
}

/// A network under one circumstance of the question `networks`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NetworkCost {
    /// Name of its recipe.
    pub network: String,
    /// The circumstance.
    pub condition: String,
    /// Mean accuracy of single sweeps; its interval is the row's.
    pub accuracy: f64,
    /// Multiply-adds of one prediction without dropout; absent where the circumstance is not the usual one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub multiply_adds: Option<f64>,
    /// Time of one training, seconds; absent where the circumstance is not the usual one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub train_seconds: Option<f64>,
}

impl Row {
    /// True if numbers that were published for TactMat may stand beside it: it has all of TactMat's materials, or the twin's.
    pub fn is_beside_published(&self) -> bool {
        self.origin.is_comparable_to_published() && self.materials == TACTMAT_MATERIALS.len()
    }
}

/// Where the numbers of one task come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TaskRecord {
    /// Name of its folder.
    pub id: String,
    /// The part of the data set that it asks about.
    pub part: Part,
    /// The call that repeats it, where it is a single training.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub command: String,
    /// The split, for people.
    pub split: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// SHA-256 of the recipe.
    pub recipe_sha256: String,
    /// Commits of the program; several where it was resumed by another build.
    pub git: Vec<String>,
    /// Time of the task, seconds.
    pub seconds: f64,
    /// Settings that were chosen on the way, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub chosen: BTreeMap<String, f64>,
}
