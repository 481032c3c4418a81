//! Errors of child processes.

use std::io;
use std::process::ExitStatus;

/// Errors of a child process; each is one line that goes on after the name of the process.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// There is no such program, or the system refuses.
    #[error("cannot be started: {0}")]
    Start(#[source] io::Error),
    /// Its first line is not `ready`.
    #[error("did not start{}", because(said))]
    NotReady {
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

/// Returns how a message goes on where the process said something.
fn because(said: &str) -> String {
    if said.is_empty() {
        String::new()
    } else {
        format!(": {said}")
    }
}
