//! Commands that run once.

use std::process::{Command, Stdio};

use crate::ProcessError;
use crate::last_lines::last_lines;

/// Runs `command` without input and returns its output. Ctrl-C on a terminal reaches the command, too.
///
/// # Errors
/// A command that cannot be started, or an exit status other than success.
pub fn run_to_end(command: &mut Command) -> Result<String, ProcessError> {
    let output = command
        .stdin(Stdio::null())
        .output()
        .map_err(ProcessError::Start)?;
    if !output.status.success() {
        return Err(ProcessError::Failed {
            status: output.status,
            said: last_lines(output.stderr.as_slice()),
        });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_is_what_it_printed_or_why_it_failed() {
        let run = |text| run_to_end(Command::new("/bin/sh").args(["-c", text]));
        assert_eq!(run("echo 1").unwrap(), "1\n");
        let failed = run("echo 1; echo why >&2; exit 2").unwrap_err();
        assert_eq!(failed.to_string(), "ended with exit status: 2: why");
        let missing = run_to_end(&mut Command::new("/no/such/program")).unwrap_err();
        assert!(missing.to_string().starts_with("cannot be started: "));
    }
}
