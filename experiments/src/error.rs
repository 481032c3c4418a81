//! Everything that can go wrong in an experiment.

use std::path::{Path, PathBuf};

use tactnet_pipeline::PipelineError;

/// An error of planning, running or reporting an experiment.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Recipes and run directories.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// The operating system refused.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file in question.
        path: PathBuf,
        /// What was attempted.
        action: &'static str,
        /// What the system said.
        source: std::io::Error,
    },
    /// Neither a built-in experiment nor a file.
    #[error(
        "experiment `{name}`: no such file and no such experiment; experiments that ship with tactnet: {known}"
    )]
    Unknown {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A recipe that cannot be used.
    #[error("experiment {origin}: {reason}")]
    Recipe {
        /// Its name or path.
        origin: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A folder that does not hold what is needed.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder, or the file in it.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// Slurm refused.
    #[error("{program}: {reason}")]
    Slurm {
        /// The program that was called.
        program: &'static str,
        /// What it said.
        reason: String,
    },
    /// Tasks that failed every time.
    #[error("{count} of {all} tasks failed; the first, {first}: {reason}")]
    Tasks {
        /// How many.
        count: usize,
        /// Of how many.
        all: usize,
        /// Name of the first.
        first: String,
        /// Last line of its log.
        reason: String,
    },
}

impl ExperimentError {
    pub(crate) fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_path_buf(),
            action,
            source,
        }
    }
}
