//! Calls of Slurm's programs.

use std::process::Command;
use std::thread;
use std::time::Duration;

use crate::ExperimentError;

/// Number of consecutive failed calls after which a run fails.
pub(super) const MAX_REFUSALS: usize = 30;

/// Parts of messages about failures that pass.
const TRANSIENT: [&str; 9] = [
    "socket timed out",
    "timed out",
    "unable to contact",
    "temporarily unable",
    "temporarily unavailable",
    "zero bytes were transmitted",
    "connection refused",
    "connection reset",
    "transport endpoint",
];

/// Returns true for a failure that may pass by itself: a busy, restarting or unreachable controller.
pub(super) fn is_transient(error: &ExperimentError) -> bool {
    let ExperimentError::Slurm { reason, .. } = error else {
        return false;
    };
    let reason = reason.to_lowercase();
    TRANSIENT.iter().any(|part| reason.contains(part))
}

/// Calls a program that only asks, again after `poll` while it fails.
///
/// # Errors
/// A program that is not installed, or that has failed for a long time.
pub(super) fn ask(
    program: &'static str,
    arguments: &[&str],
    poll: Duration,
) -> Result<String, ExperimentError> {
    let mut refused = 0;
    loop {
        let error = match call(program, arguments) {
            Ok(answer) => return Ok(answer),
            Err(error) => error,
        };
        refused += 1;
        let is_missing =
            matches!(&error, ExperimentError::Slurm { reason, .. } if reason == NOT_FOUND);
        if is_missing || refused > MAX_REFUSALS {
            return Err(error);
        }
        thread::sleep(poll);
    }
}

/// Returns true while any task of the job waits or runs.
pub(super) fn in_queue(job: &str) -> Result<bool, ExperimentError> {
    match call("squeue", &["--noheader", "--jobs", job, "--format=%i"]) {
        Ok(answer) => Ok(!answer.trim().is_empty()),
        // The controller forgets a job some minutes after its end.
        Err(ExperimentError::Slurm { reason, .. }) if reason.contains("Invalid job id") => {
            Ok(false)
        }
        Err(error) => Err(error),
    }
}

/// Reason of a program that is missing.
const NOT_FOUND: &str = "not found; Slurm's client programs must be installed";

/// Calls a program once.
///
/// # Errors
/// A program that is missing or fails, with its message in one line.
pub(super) fn call(program: &'static str, arguments: &[&str]) -> Result<String, ExperimentError> {
    let refused = |reason: String| ExperimentError::Slurm { program, reason };
    let output = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => refused(NOT_FOUND.into()),
            _ => refused(error.to_string()),
        })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(refused(said.trim().replace('\n', " / ")))
}
