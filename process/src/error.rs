//! Errors of child processes.

use std::io;
use std::process::ExitStatus;

/// Exit code of a call that must be corrected.
const USAGE: i32 = 2;

/// Errors of a child process; each is one line that goes on after the name of the process.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// There is no such program, or the system refuses.
    #[error("cannot be started: {0}")]
    Start(#[source] io::Error),
    /// Its first line is not `ready`.
    #[error("did not start{}", because(said))]
    NotReady {
        /// Its status, where it had ended by itself.
        status: Option<ExitStatus>,
        /// Its first line, or the last lines of its standard error where it printed none.
        said: String,
    },
    /// It ended with another status than success.
    #[error("ended with {status}{}", because(said))]
    Failed {
        /// Its status.
        status: ExitStatus,
        /// The last lines of its standard error.
        said: String,
    },
    /// Its pipes or its status cannot be read.
    #[error(transparent)]
    System(#[from] io::Error),
}

impl ProcessError {
    /// Returns true if the process itself says, by exit code 2, that its call must be corrected.
    pub fn is_usage(&self) -> bool {
        let status = match self {
            Self::NotReady { status, .. } => *status,
            Self::Failed { status, .. } => Some(*status),
            Self::Start(_) | Self::System(_) => None,
        };
        status.and_then(|status| status.code()) == Some(USAGE)
    }
}

/// Returns how a message goes on where the process said something.
fn because(said: &str) -> String {
    if said.is_empty() {
        String::new()
    } else {
        format!(": {said}")
    }
}
