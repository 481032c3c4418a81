//! Everything that can go wrong in an experiment.

use std::path::{Path, PathBuf};

use tactnet_data::is_wrong_path;
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
        /// The attempt, as a verb phrase.
        action: &'static str,
        /// The system's reason.
        source: std::io::Error,
    },
    /// Neither a built-in experiment nor a file.
    #[error(
        "experiment `{name}`: no such file and no such experiment; experiments that ship with tactnet: {known}"
    )]
    Unknown {
        /// The name that was asked for.
        name: String,
        /// Names that exist, separated by commas.
        known: String,
    },
    /// A recipe that cannot be used.
    #[error("experiment {origin}: {reason}")]
    Recipe {
        /// Its name or path.
        origin: String,
        /// The mistake.
        reason: String,
    },
    /// A folder that does not hold what is needed.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder, or the file in it.
        path: PathBuf,
        /// The mistake, and what would be right.
        reason: String,
    },
    /// Slurm refused.
    #[error("{program}: {reason}")]
    Slurm {
        /// The program that was called.
        program: &'static str,
        /// Its message.
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
    /// Returns true if the call must be corrected; false if something failed that another call would not mend: disk, numbers, Slurm,
    /// a task. An error that wraps another asks what it wraps.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Pipeline(error) => error.is_usage(),
            Self::Unknown { .. } | Self::Recipe { .. } | Self::Folder { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
            Self::Slurm { .. } | Self::Tasks { .. } => false,
        }
    }

    pub(crate) fn io(path: &Path, action: &'static str, source: std::io::Error) -> Self {
        Self::Io {
            path: path.to_path_buf(),
            action,
            source,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_data::DataError;

    #[test]
    fn what_the_system_refuses_is_no_mistake_of_the_call_however_it_is_wrapped() {
        let full = || std::io::Error::from(std::io::ErrorKind::StorageFull);
        let path = Path::new("report.html");
        let own = ExperimentError::io(path, "write", full());
        let data = PipelineError::Data(DataError::io(path, "read", full()));
        let pipeline = PipelineError::Io {
            path: path.into(),
            action: "write",
            source: full(),
        };
        for error in [own, data.into(), pipeline.into()] {
            assert!(!error.is_usage(), "{error}");
        }
        let number = PipelineError::NotFinite {
            what: "loss".into(),
            epoch: 1,
            batch: 1,
        };
        assert!(!ExperimentError::from(number).is_usage());
        let recipe = PipelineError::Recipe {
            origin: "a.toml".into(),
            reason: "no".into(),
        };
        assert!(ExperimentError::from(recipe).is_usage());
        let folder = ExperimentError::Folder {
            path: path.into(),
            reason: "full".into(),
        };
        assert!(folder.is_usage());
    }
}
