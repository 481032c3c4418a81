//! Errors of features, training, prediction and run directories.

use std::path::{Path, PathBuf};

use tactnet_data::{DataError, Remedy, is_wrong_path};
use tactnet_models::{MissingFeature, ModelError};

use crate::{AdaptRisk, PipelineRemedy};

/// An error of training, prediction or a run directory.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// Error of the data set.
    #[error(transparent)]
    Data(#[from] DataError),
    /// Data that is probably wrong, such as swapped axes.
    #[error("{finding}")]
    Doubtful {
        /// Description of the suspicious property.
        finding: String,
        /// Action that continues anyway.
        remedy: PipelineRemedy,
    },
    /// Error of a model.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Error of the operating system.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// Path of the file.
        path: PathBuf,
        /// Attempted action, as a verb phrase: "write".
        action: &'static str,
        /// Error of the system.
        source: std::io::Error,
    },
    /// Name of a recipe that is neither built in nor a file.
    #[error(
        "recipe `{name}`: no such file and no such recipe; recipes that ship with tactnet: {known}"
    )]
    UnknownRecipe {
        /// Name that was given.
        name: String,
        /// Known names, as text.
        known: String,
    },
    /// Invalid recipe.
    #[error("recipe {origin}: {reason}")]
    Recipe {
        /// Its name or path.
        origin: String,
        /// Reason why it is invalid.
        reason: String,
    },
    /// Invalid setting of a training or prediction.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Spec {
        /// Name of the setting.
        setting: &'static str,
        /// Valid values.
        expected: String,
        /// Value that was given.
        found: String,
    },
    /// Run directory that is incomplete or does not match.
    #[error("{}: {reason}", path.display())]
    Run {
        /// Path of the directory or of the file in it.
        path: PathBuf,
        /// Expected and found content.
        reason: String,
        /// Action that fixes the error.
        remedy: Option<PipelineRemedy>,
    },
    /// Sweeps that do not match the classifier.
    #[error("{item}: the classifier expects {expected}, the data set has {found}")]
    Incompatible {
        /// Property that differs.
        item: String,
        /// Value in the classifier's training data.
        expected: String,
        /// Value in the data set.
        found: String,
        /// Action that fixes the error.
        remedy: Option<PipelineRemedy>,
    },
    /// Material with too few training sweeps for the model.
    #[error(
        "training sweeps of `{material}`: expected at least {needed} for model `{model}`, found {found}"
    )]
    TooFewSweeps {
        /// Name of the material.
        material: String,
        /// Name of the recipe.
        model: String,
        /// Minimum number of sweeps.
        needed: usize,
        /// Number of training sweeps.
        found: usize,
        /// Built-in models that can be trained with so few sweeps.
        models: Vec<&'static str>,
    },
    /// Model that cannot be fitted to weighted sweeps.
    #[error(
        "model `{model}` cannot use sample weights; networks, `lda`, `minirocket` and `multirocket-hydra` can"
    )]
    SampleWeights {
        /// Name of the recipe.
        model: String,
    },
    /// Too few sweeps for calibrated thresholds at the requested rates.
    #[error(
        "calibration: {false_alarms_percent} % false alarms and {coverage_percent} % coverage need at least {needed} sweeps set aside, found \
         {found}, a fifth of the training sweeps"
    )]
    TooFewSetAside {
        /// Number of sweeps needed.
        needed: usize,
        /// Requested share of false alarms, in percent.
        false_alarms_percent: f64,
        /// Requested coverage of prediction sets, in percent.
        coverage_percent: f64,
        /// Number of sweeps set aside.
        found: usize,
        /// Action that makes a calibration possible.
        remedy: PipelineRemedy,
    },
    /// Material that cannot be enrolled.
    #[error("material `{material}`: {reason}")]
    Enroll {
        /// Name of the material.
        material: String,
        /// Reason why it cannot be enrolled.
        reason: String,
    },
    /// Adaptation that would probably lower the accuracy.
    #[error("the adaptation would probably lower the accuracy: {}", joined(risks))]
    AdaptRefused {
        /// Reasons, at least one.
        risks: Vec<AdaptRisk>,
    },
    /// Model without anything that unlabelled sweeps could adapt.
    #[error(
        "model `{model}` uses features without scaling, so that unlabelled sweeps cannot adapt it"
    )]
    AdaptScaling {
        /// Name of the recipe.
        model: String,
    },
    /// Model that labelled sweeps cannot adapt.
    #[error("model `{model}` is not linear, so that a few labelled sweeps cannot adapt it")]
    AdaptHead {
        /// Name of the recipe.
        model: String,
    },
    /// Committee with members that have no ONNX form.
    #[error("these members of the committee are no networks and have no ONNX form: {}", members.join(", "))]
    NotExportable {
        /// Names of the members, at least one.
        members: Vec<String>,
    },
    /// Runtime that this build lacks.
    #[error("{source}")]
    NoRuntime {
        /// Missing cargo feature, which has the name of the runtime.
        source: MissingFeature,
    },
    /// Failure of another runtime.
    #[error("{runtime}: {reason}")]
    Runtime {
        /// Name of the runtime.
        runtime: &'static str,
        /// Message of the runtime.
        reason: String,
    },
    /// A loss or weight that is not finite.
    #[error(
        "{what} is not finite in epoch {epoch}, batch {batch}; try a lower learning rate or another scaling"
    )]
    NotFinite {
        /// "loss", or the name of the weight.
        what: String,
        /// Epoch, counted from 1.
        epoch: usize,
        /// Batch, counted from 1.
        batch: usize,
    },
    /// Burn's error while storing or restoring the state of the optimiser.
    #[error("optimiser state: {0}")]
    Optimizer(String),
}

/// Setting of a recipe that is out of range.
#[derive(Debug, thiserror::Error)]
#[error("`{setting}`: expected {expected}, found {found}")]
pub(crate) struct InvalidSetting {
    /// Path of the setting in the recipe.
    pub setting: &'static str,
    /// Valid values.
    pub expected: &'static str,
    /// Value that was given.
    pub found: String,
}

impl PipelineError {
    /// Returns the action on the data that fixes the error, if there is one; the message does not contain it.
    pub fn remedy(&self) -> Option<Remedy> {
        match self {
            Self::Data(error) => error.remedy(),
            _ => match self.any_remedy()? {
                PipelineRemedy::Data(remedy) => Some(remedy),
                _ => None,
            },
        }
    }

    /// Returns another action that fixes the error, if there is one; the message does not contain it.
    pub fn pipeline_remedy(&self) -> Option<PipelineRemedy> {
        self.any_remedy()
            .filter(|remedy| !matches!(remedy, PipelineRemedy::Data(_)))
    }

    /// Returns true if the caller can fix the error, because the request or its data is at fault and not the machine.
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
            | Self::TooFewSweeps { .. }
            | Self::SampleWeights { .. }
            | Self::TooFewSetAside { .. }
            | Self::Enroll { .. }
            | Self::AdaptRefused { .. }
            | Self::AdaptScaling { .. }
            | Self::AdaptHead { .. }
            | Self::NotExportable { .. }
            | Self::NoRuntime { .. } => true,
            Self::Io { source, .. } => is_wrong_path(source),
            Self::Runtime { .. } | Self::NotFinite { .. } | Self::Optimizer(_) => false,
        }
    }

    fn any_remedy(&self) -> Option<PipelineRemedy> {
        match self {
            Self::Run { remedy, .. } | Self::Incompatible { remedy, .. } => remedy.clone(),
            Self::Doubtful { remedy, .. } | Self::TooFewSetAside { remedy, .. } => {
                Some(remedy.clone())
            }
            Self::TooFewSweeps { models, .. } => Some(PipelineRemedy::ChooseModel {
                models: models.clone(),
            }),
            Self::AdaptRefused { .. } => Some(PipelineRemedy::AcceptRisk),
            Self::AdaptScaling { .. } => Some(PipelineRemedy::ChooseScaledModel),
            Self::AdaptHead { .. } => Some(PipelineRemedy::AdaptWithoutLabels),
            Self::NotExportable { .. } => Some(PipelineRemedy::ListNetworks),
            _ => None,
        }
    }

    /// Returns an error about a run directory or a file in it.
    pub fn run(path: impl Into<PathBuf>, reason: impl Into<String>) -> Self {
        Self::Run {
            path: path.into(),
            reason: reason.into(),
            remedy: None,
        }
    }

    /// Returns an error about sweeps that do not match the classifier.
    pub fn incompatible(
        item: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Incompatible {
            item: item.into(),
            expected: expected.into(),
            found: found.into(),
            remedy: None,
        }
    }

    /// Returns the error with a remedy, if it is about a run directory or about sweeps that do not match.
    pub fn with_remedy(mut self, action: PipelineRemedy) -> Self {
        if let Self::Run { remedy, .. } | Self::Incompatible { remedy, .. } = &mut self {
            *remedy = Some(action);
        }
        self
    }

    pub(crate) fn enroll(material: &str, reason: impl Into<String>) -> Self {
        Self::Enroll {
            material: material.into(),
            reason: reason.into(),
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

/// Returns all risks as one clause.
fn joined(risks: &[AdaptRisk]) -> String {
    let texts: Vec<String> = risks.iter().map(ToString::to_string).collect();
    texts.join("; ")
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
            PipelineError::run("run", text()),
            PipelineError::incompatible("sweeps", text(), text()),
            PipelineError::TooFewSetAside {
                needed: 19,
                false_alarms_percent: 5.0,
                coverage_percent: 90.0,
                found: 16,
                remedy: PipelineRemedy::RecordMore,
            },
            PipelineError::Enroll {
                material: what("felt"),
                reason: text(),
            },
            PipelineError::NoRuntime {
                source: MissingFeature { feature: "candle" },
            },
        ] {
            assert!(error.is_usage(), "{error}");
        }
    }
}
