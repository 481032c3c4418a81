//! The `tactnet` command as a process beside this one, for commands that run several at once.

use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;

use crate::RehearsalError;

/// A process that says `ready`; it is killed if this is dropped before [`ChildProcess::end`].
pub struct ChildProcess {
    name: &'static str,
    child: Child,
    /// Reads what it prints, so that it never waits for us.
    printed: Option<JoinHandle<String>>,
}

impl ChildProcess {
    /// Starts `PROGRAM ARGUMENTS TABLE` and waits until it is ready.
    ///
    /// - `program`: the `tactnet` command
    /// - `name`: its role, for messages
    ///
    /// # Errors
    /// It cannot be started, or says something else than `ready` first.
    pub fn start(
        program: &Path,
        name: &'static str,
        arguments: &[&str],
        table: &Path,
    ) -> Result<Self, RehearsalError> {
        let failed = |error: std::io::Error| RehearsalError::child(name, error);
        let mut command = Command::new(program);
        command
            .args(arguments)
            .arg(table)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // Ctrl-C is for us; we end it in our own time.
            .process_group(0);
        // SAFETY: one system call between fork and exec.
        unsafe {
            // Nor does it stay when we are killed.
            command.pre_exec(|| {
                libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGTERM);
                Ok(())
            });
        }
        let mut child = command
            .spawn()
            .map_err(|error| RehearsalError::child(name, format!("cannot be started: {error}")))?;
        let pipes = (child.stdout.take(), child.stderr.take());
        let mut process = Self {
            name,
            child,
            printed: None,
        };
        let (Some(out), Some(errors)) = pipes else {
            return Err(RehearsalError::child(name, "has no output"));
        };
        let mut out = BufReader::new(out);
        let mut errors = BufReader::new(errors);
        let mut line = String::new();
        out.read_line(&mut line).map_err(failed)?;
        if line != "ready\n" {
            let mut said = String::new();
            errors.read_line(&mut said).map_err(failed)?;
            let reason = format!("did not start: {}", said.trim());
            return Err(RehearsalError::child(name, reason));
        }
        std::thread::spawn(move || std::io::copy(&mut errors, &mut std::io::sink()));
        process.printed = Some(std::thread::spawn(move || {
            let mut printed = String::new();
            // What is no text is not ours.
            let _ = out.read_to_string(&mut printed);
            printed
        }));
        Ok(process)
    }

    /// Returns its role.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns its status if it has ended by itself.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn ended(&mut self) -> Result<Option<ExitStatus>, RehearsalError> {
        self.child
            .try_wait()
            .map_err(|error| RehearsalError::child(self.name, error))
    }

    /// Asks it to end and returns what it printed.
    ///
    /// # Errors
    /// It ended with another status than success.
    pub fn end(mut self) -> Result<String, RehearsalError> {
        // SAFETY: the process is our child and has not been waited for, so its number is its own.
        unsafe { libc::kill(self.child.id() as libc::pid_t, libc::SIGTERM) };
        let status = self
            .child
            .wait()
            .map_err(|error| RehearsalError::child(self.name, error))?;
        let printed = match self.printed.take().map(JoinHandle::join) {
            Some(Ok(printed)) => printed,
            _ => return Err(RehearsalError::child(self.name, "printed nothing")),
        };
        if !status.success() {
            let reason = format!("ended with {status}");
            return Err(RehearsalError::child(self.name, reason));
        }
        Ok(printed)
    }

    /// Asks it to end and returns the report that it printed as one JSON document.
    ///
    /// # Errors
    /// As [`ChildProcess::end`]; another document than a `T`.
    pub fn end_with_report<T: serde::de::DeserializeOwned>(self) -> Result<T, RehearsalError> {
        let name = self.name;
        serde_json::from_str(&self.end()?).map_err(|source| RehearsalError::Report { name, source })
    }
}

impl Drop for ChildProcess {
    fn drop(&mut self) {
        // Both fail where it has ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[cfg(test)]
mod tests {
    use tactnet_serving::ServeReport;

    use super::*;

    fn printing(text: &str) -> ChildProcess {
        // As the service does: the report comes at the end, when asked to end.
        let script = format!(
            "report() {{ echo '{text}'; exit 0; }}; trap report TERM; echo ready; while :; do sleep 0.01; done"
        );
        let arguments = ["-c", script.as_str()];
        ChildProcess::start(
            Path::new("/bin/sh"),
            "classifier",
            &arguments,
            Path::new("table"),
        )
        .unwrap()
    }

    #[test]
    fn a_renamed_counter_in_a_report_is_an_error_and_not_zero() {
        let report = serde_json::to_string(&ServeReport::default()).unwrap();
        let read: ServeReport = printing(&report).end_with_report().unwrap();
        assert_eq!(read, ServeReport::default());
        let renamed = report.replace("dropped_frames", "lost_frames");
        let error = printing(&renamed)
            .end_with_report::<ServeReport>()
            .unwrap_err();
        assert!(error.to_string().contains("lost_frames"), "{error}");
        assert!(!error.is_usage());
    }

    #[test]
    fn a_child_that_does_not_get_ready_says_why() {
        let arguments = ["-c", "echo 'no hub' >&2; exit 2"];
        let started = ChildProcess::start(Path::new("/bin/sh"), "skin", &arguments, Path::new("t"));
        let error = started.err().unwrap().to_string();
        assert_eq!(error, "the skin did not start: no hub");
    }
}
