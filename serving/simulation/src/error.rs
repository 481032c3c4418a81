//! Errors of simulated robots.

use tactnet_data::DataError;
use tactnet_process::ProcessError;

/// Errors of a rehearsal; each is one line for people.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// The channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// The table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// The page in the browser.
    #[error(transparent)]
    Serve(#[from] tactnet_serving::ServeError),
    /// The catching stack in its simulated world.
    #[cfg(feature = "catching")]
    #[error(transparent)]
    Catching(#[from] tactnet_catching_stage::StageError),
    /// A recording.
    #[cfg(feature = "recording")]
    #[error(transparent)]
    Recording(#[from] tactnet_recording::RecordingError),
    /// The table of channels, as text.
    #[error("the table of channels: {0}")]
    Table(#[from] toml::ser::Error),
    /// A material that the data set does not have.
    #[error("no material `{material}`; there are {known}")]
    NoMaterial {
        /// The material asked for.
        material: String,
        /// Those of the data set.
        known: String,
    },
    /// A material of which too few sweeps may be played.
    #[error(
        "`{material}` has {found} sweeps that may be played, an object {in_a_row}; `--sweeps-per-object` sets how many an object has"
    )]
    TooFewSweeps {
        /// The material.
        material: String,
        /// Its sweeps.
        found: usize,
        /// Sweeps of each material in a row.
        in_a_row: usize,
    },
    /// The network knows none of the data set's materials.
    #[error("{data}: no material that the network knows")]
    NothingKnown {
        /// Name of the data set.
        data: String,
    },
    /// SCHED_FIFO was asked for and is not allowed.
    #[error("{reason}")]
    NoFifo {
        /// Answer of the system.
        reason: String,
    },
    /// Ctrl-C before the first turn was over.
    #[error("stopped before anything was measured")]
    Stopped,
    /// A process beside this one could not be started, or ended badly.
    #[error("the {name} {reason}")]
    Child {
        /// Its role, such as `classifier`.
        name: String,
        /// The verb and its reason.
        reason: String,
    },
    /// A process beside this one says that its call must be corrected, and with it this one's.
    #[error("the {name} {reason}")]
    Refused {
        /// Its role, such as `classifier`.
        name: String,
        /// The verb and its reason.
        reason: String,
    },
    /// A process ended with another report than this version reads.
    #[error("the {name} printed no report that this version reads: {source}")]
    Report {
        /// Its role.
        name: &'static str,
        /// Position and kind of the mistake.
        source: serde_json::Error,
    },
    /// A file cannot be written.
    #[error(transparent)]
    Data(#[from] DataError),
}

impl SimulationError {
    /// Returns true where the call must be corrected (exit code 2), false where something broke (exit code 1).
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

    /// The error of the process with the role `name`.
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
