//! The results of an experiment: the numbers of the report.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};
use tactnet_data::DataOrigin;

use crate::answer::FeatureMap;
use crate::audit::Audit;
use crate::benchmark::Benchmark;
use crate::comparison::Comparison;
use crate::contender::Contender;
use crate::groups::Grouping;
use crate::part::Part;
use crate::plan::{LeftOut, Task};
use crate::questions::{Question, SampleEfficiency};
use crate::row::Row;

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
    /// Reasons to doubt the numbers, such as materials that were recorded in one block each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data_warnings: Vec<String>,
    /// Models that cannot be trained on a data set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
    /// Commits of the programs that ran the tasks.
    pub git: Vec<String>,
    /// Seed of all random choices.
    pub seed: u64,
    /// Number of finished tasks.
    pub tasks_done: usize,
    /// Number of all tasks.
    pub tasks: usize,
    /// Number of tasks that a process runs at the moment.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tasks_running: usize,
    /// Tasks that failed, by model and cause.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub failed: Vec<FailedTasks>,
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
    /// Comparison of models over the data sets; only for a cross-validation on several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub benchmark: Option<Benchmark>,
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

    /// Returns the data sets that do not state their sample rate; `own` also stands for `own, labels permuted`.
    pub fn assumed_rates(&self) -> Vec<AssumedRate<'_>> {
        let is_treated = |name: &str| {
            self.data.keys().any(|whole| {
                name.strip_prefix(whole.as_str())
                    .is_some_and(|rest| rest.starts_with(", "))
            })
        };
        let whole = self.data.iter().filter(|(name, _)| !is_treated(name));
        whole
            .filter_map(|(data, record)| {
                let rate_hz = record.assumed_rate_hz?;
                Some(AssumedRate { data, rate_hz })
            })
            .collect()
    }
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

/// Tasks of one model that failed for one reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailedTasks {
    /// Name of the model in the recipe.
    pub model: String,
    /// Number of tasks.
    pub tasks: usize,
    /// Name of the first one.
    pub first: String,
    /// Last message of the first one: cause and remedy.
    pub reason: String,
}

impl FailedTasks {
    /// Groups failed tasks, in their order.
    ///
    /// - `failures`: tasks with their last messages
    pub(crate) fn of<'a>(failures: impl Iterator<Item = (&'a Task, String)>) -> Vec<Self> {
        let mut groups: Vec<Self> = Vec::new();
        for (task, reason) in failures {
            let is_same = |group: &&mut Self| group.model == task.model && group.reason == reason;
            match groups.iter_mut().find(is_same) {
                Some(group) => group.tasks += 1,
                None => groups.push(Self {
                    model: task.model.clone(),
                    tasks: 1,
                    first: task.id.clone(),
                    reason,
                }),
            }
        }
        groups
    }
}

/// A data set without a stated sample rate. Its text is a warning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssumedRate<'a> {
    /// Name of the data set.
    pub data: &'a str,
    /// Assumed sample rate, in Hz.
    pub rate_hz: f64,
}

impl fmt::Display for AssumedRate<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { data, rate_hz } = self;
        write!(
            f,
            "{data} does not state its sample rate; {rate_hz} Hz is assumed"
        )
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
