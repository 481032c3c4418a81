//! Questions and answers: what was measured, beside what was published.
//!
//! ```text
//! ExperimentRecipe ─> Plan (tasks) ─> run_locally | run_on_slurm ─> run directories ─> Summary ─> HTML page
//! ```

mod audit;
mod comparison;
mod error;
mod event;
mod groups;
mod local;
mod mlflow;
mod plan;
mod published;
mod published_confusion;
mod recipe;
mod report;
mod slurm;
mod statistic;
mod study;
mod study_summary;
mod summarise;
mod summary;
mod tasks;

pub(crate) use audit::audits;
pub use comparison::{Audit, Comparison};
pub use error::ExperimentError;
pub use event::Event;
pub use groups::{
    Grouping, adjusted_rand_index, best_consecutive_cut, consecutive, group_accuracy,
    grouping_of_counts, spectral_groups,
};
pub use local::{LocalPool, run_locally, run_task};
pub use mlflow::export_mlflow;
pub use plan::{Plan, Task};
pub use published::{PUBLISHED, PublishedAccuracy, published_for};
pub use recipe::{ExperimentRecipe, Probe, Range, Search, Split, StudySettings, Variant};
pub use report::to_html;
pub use slurm::{SlurmArray, run_on_slurm};
pub use statistic::{Statistic, resampled_t_test};
pub use study::{
    FeatureMap, Measurement, Study, StudyResult, StudyTask, TransferMethod, run_study,
};
pub use study_summary::{SampleEfficiency, StudyComparison, StudyRecord, StudyRow, StudySummary};
pub use summarise::summarise;
pub use summary::{FoldRecord, Published, ReliabilityBin, RiskCoverage, Row, Summary};
pub use tasks::{ExperimentDir, TaskState};
