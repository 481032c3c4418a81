//! Errors of experiments.

use std::path::{Path, PathBuf};

use tactnet_data::{Remedy, is_wrong_path};
use tactnet_pipeline::PipelineError;

/// An error of planning, running or reporting an experiment.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Error of a recipe or a run directory.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// Error of the operating system.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// Attempted operation, as a verb phrase.
        action: &'static str,
        /// Cause reported by the operating system.
        source: std::io::Error,
    },
    /// The name is neither a built-in experiment nor a file.
    #[error(
        "experiment `{name}`: no such file and no such experiment; built-in experiments: {known}"
    )]
    Unknown {
        /// Requested name.
        name: String,
        /// Known names, separated by commas.
        known: String,
    },
    /// Invalid recipe.
    #[error("experiment {origin}: {reason}")]
    Recipe {
        /// Name or path of the recipe.
        origin: String,
        /// Description of the mistake.
        reason: String,
    },
    /// Unexpected content of a folder.
    #[error("{}: {reason}", path.display())]
    Folder {
        /// The folder, or the file in it.
        path: PathBuf,
        /// Expected and found content.
        reason: String,
    },
    /// The folder contains no experiment.
    #[error("{}: no experiment here (no experiment.json)", path.display())]
    NotPlanned {
        /// The folder.
        path: PathBuf,
    },
    /// The folder cannot hold a new experiment.
    #[error("{}: {reason}", path.display())]
    Occupied {
        /// The folder, or the file in it.
        path: PathBuf,
        /// Expected and found content.
        reason: String,
    },
    /// A data set is too small for the experiment.
    #[error("experiment {origin}: {reason}")]
    Unsuitable {
        /// Name of the recipe.
        origin: String,
        /// Expected and found sweeps or materials.
        reason: String,
        /// Settings with which the experiment is possible; empty if there are none.
        settings: Vec<Setting>,
    },
    /// Error of a Slurm program.
    #[error("{program}: {reason}")]
    Slurm {
        /// Name of the program.
        program: &'static str,
        /// Message of the program.
        reason: String,
    },
    /// A disk without space for the results of a task.
    #[error(
        "{}: the disk is full, a quota is used up, or files may not be that large; what has finished is kept ({first}: {reason})", path.display()
    )]
    DiskFull {
        /// Folder of the experiment.
        path: PathBuf,
        /// Name of the task that failed first.
        first: String,
        /// Last line of its log.
        reason: String,
    },
    /// Tasks that failed in every attempt.
    #[error("{count} of {all} tasks failed; the first, {first}: {reason}")]
    Tasks {
        /// Number of failed tasks.
        count: usize,
        /// Number of all tasks.
        all: usize,
        /// Name of the first failed task.
        first: String,
        /// Last line of its log.
        reason: String,
    },
}

/// A remedy that is specific to experiments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExperimentRemedy<'a> {
    /// Run an experiment first, and name its folder.
    Run,
    /// Name another folder.
    OtherFolder,
    /// Set these fields of the recipe.
    Set(&'a [Setting]),
}

/// A field of a recipe with a value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// Path of the field.
    pub field: &'static str,
    /// Value in TOML.
    pub value: String,
}

impl ExperimentError {
    /// Returns the cure that the caller can apply, if there is one; the message does not contain it.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Pipeline(error) => error.remedy(),
            _ => None,
        }
    }

    /// Returns true for a mistake in the call, and false for a failure of the disk, of Slurm, of a task or of the
    /// numerics. A wrapping error returns the class of its cause.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Pipeline(error) => error.is_usage(),
            Self::Unknown { .. }
            | Self::Recipe { .. }
            | Self::Folder { .. }
            | Self::NotPlanned { .. }
            | Self::Occupied { .. }
            | Self::Unsuitable { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
            Self::Slurm { .. } | Self::Tasks { .. } | Self::DiskFull { .. } => false,
        }
    }

    /// Returns the remedy that is specific to experiments; the front end names the options for it.
    pub fn experiment_remedy(&self) -> Option<ExperimentRemedy<'_>> {
        match self {
            Self::NotPlanned { .. } => Some(ExperimentRemedy::Run),
            Self::Occupied { .. } => Some(ExperimentRemedy::OtherFolder),
            Self::Unsuitable { settings, .. } if !settings.is_empty() => {
                Some(ExperimentRemedy::Set(settings))
            }
            _ => None,
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
