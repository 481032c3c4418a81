//! Errors of child processes.

use std::io;
use std::process::ExitStatus;

/// Exit code of a process whose call must be corrected.
const USAGE: i32 = 2;

/// Error of a child process; each message is one line that continues the name of the process.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// The program is missing or cannot be started.
    #[error("cannot be started: {0}")]
    Start(#[source] io::Error),
    /// The first line of the process is not `ready`.
    #[error("did not start{}", because(said))]
    NotReady {
        /// Exit status, if the process had ended by itself.
        status: Option<ExitStatus>,
        /// First line of the process, or the last lines of its standard error if it printed none.
        said: String,
    },
    /// The process failed.
    #[error("ended with {status}{}", because(said))]
    Failed {
        /// Exit status.
        status: ExitStatus,
        /// Last lines of its standard error.
        said: String,
    },
    /// The pipes or the status of the process cannot be read.
    #[error(transparent)]
    System(#[from] io::Error),
}

impl ProcessError {
    /// Returns true if the exit code of the process is 2: its call must be corrected.
    pub fn is_usage(&self) -> bool {
        let status = match self {
            Self::NotReady { status, .. } => *status,
            Self::Failed { status, .. } => Some(*status),
            Self::Start(_) | Self::System(_) => None,
        };
        status.and_then(|status| status.code()) == Some(USAGE)
    }
}

/// Returns the end of a message that quotes the output of the process.
fn because(said: &str) -> String {
    if said.is_empty() {
        String::new()
    } else {
        format!(": {said}")
    }
}
