//! Experiments: train and evaluate classifiers on data sets, and compare the results with published numbers.
//!
//! ```text
//! ExperimentRecipe ─> Plan (tasks) ─> run_locally | run_on_slurm ─> run directories ─> Summary ─> HTML page
//! ```

mod assumed_rate;
mod comparison;
mod context;
mod error;
mod event;
mod groups;
mod interval_note;
mod local;
mod measure;
mod mlflow;
mod networks;
mod one_or_many;
mod pairs;
mod part;
mod plan;
mod published;
mod published_confusion;
mod questions;
mod recipe;
mod report;
mod result;
mod run_text;
mod settings;
mod slurm;
mod statistic;
mod status;
mod suitable;
mod summarise;
mod summary;
mod table;
mod task_process;
mod tasks;
mod time_left;

pub use assumed_rate::assumed_rate_text;
pub use comparison::Comparison;
pub use error::ExperimentError;
pub use event::Event;
pub use groups::{
    Grouping, adjusted_rand_index, best_consecutive_cut, consecutive, group_accuracy,
    grouping_of_counts, spectral_groups,
};
pub use local::{LocalPool, run_locally, run_task};
pub use measure::{Measure, Measurement, Unit};
pub use mlflow::export_mlflow;
pub use part::Part;
pub use plan::{Job, Plan, QuestionTask, Task};
pub use published::{PUBLISHED, PublishedAccuracy, published_for};
pub use questions::{
    Audit, Contender, Crossval, Differentiate, Enrolment, FeatureMap, FeatureMaps, FoldRecord,
    Nshot, Probe, PublishedContender, Question, ReliabilityBin, RiskCoverage, SampleEfficiency,
    Sequential, TransferMethod, Unknown,
};
pub use recipe::{ExperimentRecipe, Range, Search, Variant};
pub use report::to_html;
pub use result::{QuestionResult, answer_question};
pub use run_text::{advice, next_steps, run_text};
pub use slurm::{SlurmArray, run_on_slurm};
pub use statistic::{Statistic, holm, resampled_t_test};
pub use status::{Status, TaskStatus};
pub use summarise::summarise;
pub use summary::{DataRecord, Row, Summary, TaskRecord};
pub use table::to_table;
pub use tasks::{ExperimentDir, STOPPING, Start, TaskState};
pub use time_left::TimeLeft;
