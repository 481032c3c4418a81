//! Errors of the stage.

use tactnet_process::ProcessError;

/// Why a run or the world ends; each is one line for people.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// The channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// The recording.
    #[error(transparent)]
    Recording(#[from] tactnet_recording::RecordingError),
    /// The stack's settings.
    #[error(transparent)]
    Role(#[from] tactnet_catching_roles::RoleError),
    /// The world's settings.
    #[error(transparent)]
    World(#[from] tactnet_catching_world::WorldError),
    /// A file that cannot be written.
    #[error("{path}: {source}", path = .path.display())]
    Io {
        /// The file.
        path: std::path::PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The table of channels, as text.
    #[error("the table of channels: {0}")]
    Table(#[from] toml::ser::Error),
    /// A process that does not start.
    #[error("the {name} {source}")]
    Process {
        /// Its role.
        name: &'static str,
        /// What it said.
        source: ProcessError,
    },
    /// A process that ends again and again.
    #[error("the {name} has ended {times} times: {said}")]
    KeepsEnding {
        /// Its role.
        name: &'static str,
        /// How often.
        times: usize,
        /// What it said last.
        said: String,
    },
    /// The robot does not get ready for a throw.
    #[error("no throw for {seconds} s: the robot {phase}: {reason}")]
    NoThrow {
        /// How long was waited.
        seconds: u64,
        /// What it is about.
        phase: &'static str,
        /// Why.
        reason: String,
    },
}

impl StageError {
    /// Returns true where the call must be corrected (exit code 2), false where something broke (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Channel(error) => error.is_usage(),
            Self::Recording(error) => error.is_usage(),
            Self::Role(error) => error.is_usage(),
            Self::Process { source, .. } => source.is_usage(),
            Self::World(_) => true,
            Self::Io { .. } | Self::Table(_) | Self::KeepsEnding { .. } | Self::NoThrow { .. } => {
                false
            }
        }
    }
}
