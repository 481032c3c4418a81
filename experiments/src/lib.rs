//! Experiments: train and evaluate classifiers on data sets, and compare the results with published numbers.
//!
//! ```text
//! ExperimentRecipe ─> Plan (tasks) ─> run_locally | run_on_slurm ─> run directories ─> Summary ─> HTML page
//! ```

mod answer;
mod audit;
mod benchmark;
mod comparison;
mod confidence;
mod contender;
mod context;
mod data_folder;
mod data_probes;
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
mod phrases;
mod plan;
mod probe;
mod published;
mod published_confusion;
mod questions;
mod ranks;
mod recipe;
mod report;
mod result;
mod row;
mod scored;
mod settings;
mod slurm;
mod statistic;
mod status;
mod summarise;
mod summary;
mod sweep_length;
mod tasks;
mod time_left;

pub use answer::FeatureMap;
pub use audit::Audit;
pub use benchmark::{
    Benchmark, Candidate, Condition, ConditionScores, DefaultModel, ModelScore, Objection, Score,
    SetResult, SetScores,
};
pub use comparison::{Comparison, name_in_comparison};
pub use confidence::{ReliabilityBin, RiskCoverage};
pub use contender::{Contender, FoldRecord, PublishedContender};
pub use data_probes::{BlockIdentity, DataProbes};
pub use error::{ExperimentError, ExperimentRemedy, Setting};
pub use event::Event;
pub use groups::{Grouping, grouping_of_counts};
pub use interval_note::interval_notes;
pub use local::{LocalPool, run_locally, run_task};
pub use measure::{Measure, Measurement, Unit, method_name};
pub use mlflow::export_mlflow;
pub use part::Part;
pub use plan::{Job, LeftOut, Plan, QuestionTask, RecipeWithData, Task};
pub use probe::Probe;
pub use published::{PUBLISHED, PublishedAccuracy, published_for};
pub use questions::{
    Crossval, Differentiate, Enrolment, FeatureMaps, Networks, Nshot, Question, SampleEfficiency,
    Sequential, TransferMethod, Unknown,
};
pub use recipe::{ExperimentRecipe, Range, Search, Variant};
pub use report::to_html;
pub use result::{QuestionResult, answer_question};
pub use row::{NetworkCost, Row};
pub use scored::{FewSteps, Scored};
pub use slurm::{SlurmArray, run_on_slurm};
pub use statistic::{Statistic, holm, resampled_t_test};
pub use status::{Status, TaskStatus};
pub use summarise::summarise;
pub use summary::{AssumedRate, DataRecord, FailedTasks, Summary, TaskRecord};
pub use sweep_length::{NamedLength, SweepLength};
pub use tasks::{ExperimentDir, STOPPING, Start, TaskState};
pub use time_left::TimeLeft;
