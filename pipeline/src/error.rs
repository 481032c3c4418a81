//! Everything that can go wrong between sweeps and predictions.

use std::path::{Path, PathBuf};

use tactnet_data::{DataError, is_wrong_path};
use tactnet_models::{ModelError, left_out};

/// An error of training, prediction or a run directory.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Sweeps that most likely are not what they seem.
    #[error("{finding}; {remedy}")]
    Doubtful {
        /// What is odd about them.
        finding: String,
        /// How to go on all the same.
        remedy: &'static str,
    },
    /// The network.
    #[error(transparent)]
    Model(#[from] ModelError),
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
    /// Neither a built-in recipe nor a file.
    #[error(
        "recipe `{name}`: no such file and no such recipe; recipes that ship with tactnet: {known}"
    )]
    UnknownRecipe {
        /// What was asked for.
        name: String,
        /// What there is.
        known: String,
    },
    /// A recipe that cannot be used.
    #[error("recipe {origin}: {reason}")]
    Recipe {
        /// Its name or path.
        origin: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A training that cannot be done as it was asked for.
    #[error("`--{setting}`: expected {expected}, found {found}")]
    Spec {
        /// The setting, as on the command line without dashes.
        setting: &'static str,
        /// What could be done.
        expected: String,
        /// What was asked for.
        found: String,
    },
    /// A run directory that does not hold what is needed.
    #[error("{}: {reason}", path.display())]
    Run {
        /// The directory, or the file in it.
        path: PathBuf,
        /// What is wrong, and what would be right.
        reason: String,
    },
    /// Sweeps that do not fit the classifier.
    #[error("{item}: the classifier expects {expected}, the data set has {found}")]
    Incompatible {
        /// What differs.
        item: String,
        /// What the classifier was trained on.
        expected: String,
        /// What came.
        found: String,
    },
    /// Too few sweeps for thresholds that keep their rates.
    #[error(
        "calibration: {false_alarms_percent} % false alarms and {coverage_percent} % coverage need at least {needed} sweeps set aside, a fifth of \
         the training sweeps are {found}; {remedy}"
    )]
    TooFewSetAside {
        /// Sweeps that would do.
        needed: usize,
        /// Asked for.
        false_alarms_percent: f64,
        /// Asked for.
        coverage_percent: f64,
        /// Sweeps that there are.
        found: usize,
        /// What can be done.
        remedy: String,
    },
    /// A material that cannot be added.
    #[error("material `{material}`: {reason}")]
    Enroll {
        /// Its name.
        material: String,
        /// Why not.
        reason: String,
    },
    /// A form of the network that this program was built without.
    #[error("{}", left_out(runtime))]
    NoRuntime {
        /// Its name, which is that of the cargo feature.
        runtime: &'static str,
    },
    /// Another form of the network that cannot be made or run.
    #[error("{runtime}: {reason}")]
    Runtime {
        /// Its name.
        runtime: &'static str,
        /// What it said.
        reason: String,
    },
    /// The loss or a weight is no number any more.
    #[error(
        "{what} is not finite in epoch {epoch}, batch {batch}; try a lower learning rate or another scaling"
    )]
    NotFinite {
        /// "loss" or the name of a weight.
        what: String,
        /// Epoch, counted from 1.
        epoch: usize,
        /// Batch, counted from 1.
        batch: usize,
    },
    /// Burn could not store or restore the optimiser's state.
    #[error("optimiser state: {0}")]
    Optimizer(String),
}

/// A setting of a recipe that is out of range.
#[derive(Debug, thiserror::Error)]
#[error("`{setting}`: expected {expected}, found {found}")]
pub(crate) struct InvalidSetting {
    /// Its path in the recipe.
    pub setting: &'static str,
    /// What it may be.
    pub expected: &'static str,
    /// What it is.
    pub found: String,
}

impl PipelineError {
    /// Returns true if another call would succeed: the mistake is in what was asked for or in what was handed over, not in the machine.
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Data(error) => error.is_usage(),
            Self::Model(error) => !matches!(error, ModelError::Fit { .. }),
            Self::UnknownRecipe { .. }
            | Self::Recipe { .. }
            | Self::Spec { .. }
            | Self::Run { .. }
            | Self::Incompatible { .. }
            | Self::Doubtful { .. }
            | Self::TooFewSetAside { .. }
            | Self::Enroll { .. }
            | Self::NoRuntime { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
            Self::Runtime { .. } | Self::NotFinite { .. } | Self::Optimizer(_) => false,
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

    fn io() -> std::io::Error {
        std::io::Error::from(std::io::ErrorKind::StorageFull)
    }

    #[test]
    fn wrapping_errors_ask_what_they_wrap() {
        let path = Path::new("sweeps.h5");
        assert!(!PipelineError::from(DataError::io(path, "write", io())).is_usage());
        let damaged = DataError::format(path, "file", "HDF5", "text");
        assert!(PipelineError::from(damaged).is_usage());
        let fit = ModelError::Fit {
            what: "ridge classifier",
            reason: "no eigenvalues".into(),
        };
        assert!(!PipelineError::from(fit).is_usage());
        let setting = ModelError::Setting {
            setting: "maps",
            expected: "at least 1".into(),
            found: "0".into(),
        };
        assert!(PipelineError::from(setting).is_usage());
    }

    #[test]
    fn what_another_call_would_not_mend_is_no_usage() {
        let (what, text) = (String::from, String::new);
        for error in [
            PipelineError::io(Path::new("run"), "write", io()),
            PipelineError::NotFinite {
                what: what("loss"),
                epoch: 1,
                batch: 2,
            },
            PipelineError::Optimizer(text()),
            PipelineError::Runtime {
                runtime: "candle",
                reason: text(),
            },
        ] {
            assert!(!error.is_usage(), "{error}");
        }
        for error in [
            PipelineError::UnknownRecipe {
                name: what("fats"),
                known: what("fast"),
            },
            PipelineError::Recipe {
                origin: what("own.toml"),
                reason: text(),
            },
            PipelineError::Spec {
                setting: "epochs",
                expected: what("at least 1"),
                found: what("0"),
            },
            PipelineError::Run {
                path: "run".into(),
                reason: text(),
            },
            PipelineError::Incompatible {
                item: "sweeps".into(),
                expected: text(),
                found: text(),
            },
            PipelineError::TooFewSetAside {
                needed: 19,
                false_alarms_percent: 5.0,
                coverage_percent: 90.0,
                found: 16,
                remedy: text(),
            },
            PipelineError::Enroll {
                material: what("felt"),
                reason: text(),
            },
            PipelineError::NoRuntime { runtime: "candle" },
        ] {
            assert!(error.is_usage(), "{error}");
        }
    }
}
