//! Errors of simulated robots.

use tactnet_data::DataError;
use tactnet_process::ProcessError;

/// Error of a simulation; each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// Error of the channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// Error in the table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// Error of the live page.
    #[error(transparent)]
    Serve(#[from] tactnet_serving::ServeError),
    /// Error of the catching stack in its simulated world.
    #[cfg(feature = "catching")]
    #[error(transparent)]
    Catching(#[from] tactnet_catching_stage::StageError),
    /// Error of a recording.
    #[cfg(feature = "recording")]
    #[error(transparent)]
    Recording(#[from] tactnet_recording::RecordingError),
    /// The channel table cannot be represented as text.
    #[error("cannot write the channel table as text: {0}")]
    Table(#[from] toml::ser::Error),
    /// The data set does not have the material.
    #[error("no material `{material}`; there are {known}")]
    NoMaterial {
        /// The requested material.
        material: String,
        /// Materials of the data set.
        known: String,
    },
    /// Too few sweeps of a material may be played.
    #[error("`{material}` has {found} playable sweeps, but an object needs {in_a_row}")]
    TooFewSweeps {
        /// Name of the material.
        material: String,
        /// Number of playable sweeps.
        found: usize,
        /// Number of sweeps per object.
        in_a_row: usize,
    },
    /// The network knows none of the data set's materials.
    #[error("{data}: none of its materials is known to the network")]
    NothingKnown {
        /// Name of the data set.
        data: String,
    },
    /// SCHED_FIFO was requested but is not permitted.
    #[error("{reason}")]
    NoFifo {
        /// Error of the operating system.
        reason: String,
    },
    /// The user stopped the test before the first turn ended.
    #[error("stopped before anything was measured")]
    Stopped,
    /// A child process did not start, or failed.
    #[error("the {name} {reason}")]
    Child {
        /// Role of the process, such as `classifier`.
        name: String,
        /// Verb and reason.
        reason: String,
    },
    /// A child process reports a wrong call, which is caused by a wrong call of this process.
    #[error("the {name} {reason}")]
    Refused {
        /// Role of the process, such as `classifier`.
        name: String,
        /// Verb and reason.
        reason: String,
    },
    /// A child process printed a report with another format.
    #[error("the report of the {name} has another format than expected: {source}")]
    Report {
        /// Role of the process.
        name: &'static str,
        /// Position and kind of the parse error.
        source: serde_json::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Data(#[from] DataError),
}

impl SimulationError {
    /// Returns true if the caller must correct the call (exit code 2), false for other failures (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Channel(error) => error.is_usage(),
            Self::Skin(error) => error.is_usage(),
            Self::Serve(error) => error.is_usage(),
            #[cfg(feature = "catching")]
            Self::Catching(error) => error.is_usage(),
            #[cfg(feature = "recording")]
            Self::Recording(error) => error.is_usage(),
            Self::NoMaterial { .. }
            | Self::TooFewSweeps { .. }
            | Self::NothingKnown { .. }
            | Self::Refused { .. }
            | Self::NoFifo { .. } => true,
            Self::Table(_) | Self::Stopped | Self::Child { .. } | Self::Report { .. } => false,
            Self::Data(error) => error.is_usage(),
        }
    }

    pub(crate) fn child(name: &str, reason: impl std::fmt::Display) -> Self {
        Self::Child {
            name: name.into(),
            reason: reason.to_string(),
        }
    }

    /// Converts an error of the process with the role `name`.
    pub(crate) fn process(name: &str, error: &ProcessError) -> Self {
        if error.is_usage() {
            Self::Refused {
                name: name.into(),
                reason: error.to_string(),
            }
        } else {
            Self::child(name, error)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrong_calls_are_usage_and_children_that_end_are_not() {
        let usage = [
            SimulationError::TooFewSweeps {
                material: "cork".into(),
                found: 0,
                in_a_row: 1,
            },
            SimulationError::NoFifo {
                reason: "not permitted".into(),
            },
            SimulationError::Channel(tactnet_channel::ChannelError::EmptyGroup),
            SimulationError::Skin(tactnet_skin::SkinError::Section("`finger`".into())),
        ];
        assert!(usage.iter().all(SimulationError::is_usage));
        let broke = [
            SimulationError::Stopped,
            SimulationError::child("classifier", "ended with signal 9"),
            SimulationError::Data(DataError::Io {
                path: "robot.toml".into(),
                action: "write",
                source: std::io::ErrorKind::StorageFull.into(),
            }),
        ];
        assert!(!broke.iter().any(SimulationError::is_usage));
    }
}
