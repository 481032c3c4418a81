//! Errors of the stage.

use tactnet_process::ProcessError;

/// Error that ends a run or the world. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum StageError {
    /// Error of the channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// Error of the recording.
    #[error(transparent)]
    Recording(#[from] tactnet_recording::RecordingError),
    /// Invalid settings of the stack, or an error of one of its processes.
    #[error(transparent)]
    Role(#[from] tactnet_catching_roles::RoleError),
    /// Invalid settings of the world.
    #[error(transparent)]
    World(#[from] tactnet_catching_world::WorldError),
    /// A file cannot be written.
    #[error("{path}: {source}", path = .path.display())]
    Io {
        /// Path of the file.
        path: std::path::PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The table of channels cannot be written as TOML.
    #[error("the table of channels: {0}")]
    Table(#[from] toml::ser::Error),
    /// A process did not start.
    #[error("the {name} {source}")]
    Process {
        /// Name of its role.
        name: String,
        /// Error, including its last message.
        source: ProcessError,
    },
    /// A process ended too often soon after its start.
    #[error("the {name} ended {times} times: {said}")]
    KeepsEnding {
        /// Name of its role.
        name: String,
        /// Number of ends.
        times: usize,
        /// Its last message.
        said: String,
    },
    /// The robot did not get ready for a throw.
    #[error("no throw for {seconds} s: the robot {phase}: {reason}")]
    NoThrow {
        /// Waiting time, in s.
        seconds: u64,
        /// Phase of the robot.
        phase: &'static str,
        /// Reason that the robot gave.
        reason: String,
    },
}

impl StageError {
    /// Returns true if the caller can correct the error (exit code 2), false for a failure at run time (exit code 1).
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
