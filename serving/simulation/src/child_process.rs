//! Child processes of the command-line program, for commands that run several processes.

use std::path::Path;
use std::process::{Command, ExitStatus};

use tactnet_process::ReadyProcess;

use crate::SimulationError;

/// A child process with a role. It is killed if it is dropped before [`ChildProcess::end`].
pub struct ChildProcess {
    name: &'static str,
    process: ReadyProcess,
}

impl ChildProcess {
    /// Starts `PROGRAM ARGUMENTS TABLE` and waits until the process is ready.
    ///
    /// - `program`: path of the command-line program
    /// - `name`: role of the process, for messages
    ///
    /// # Errors
    /// Fails if the process does not start, or does not print `ready` first.
    pub fn start(
        program: &Path,
        name: &'static str,
        arguments: &[&str],
        table: &Path,
    ) -> Result<Self, SimulationError> {
        let mut command = Command::new(program);
        command.args(arguments).arg(table);
        let started = ReadyProcess::start(&mut command).and_then(|mut process| {
            process.wait_until_ready()?;
            Ok(process)
        });
        match started {
            Ok(process) => Ok(Self { name, process }),
            Err(error) => Err(SimulationError::process(name, &error)),
        }
    }

    /// Returns the role.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns the exit status if the process has ended by itself.
    ///
    /// # Errors
    /// Fails if the operating system does not report the status.
    pub fn ended(&mut self) -> Result<Option<ExitStatus>, SimulationError> {
        let ended = self.process.ended();
        ended.map_err(|error| SimulationError::process(self.name, &error))
    }

    /// Asks the process to end and returns its output.
    ///
    /// # Errors
    /// Fails if the exit status is not success.
    pub fn end(self) -> Result<String, SimulationError> {
        let ended = self.process.end();
        ended.map_err(|error| SimulationError::process(self.name, &error))
    }

    /// Asks the process to end and parses its output as one JSON document.
    ///
    /// # Errors
    /// Fails as [`ChildProcess::end`] does, or if the document is not a `T`.
    pub fn end_with_report<T: serde::de::DeserializeOwned>(self) -> Result<T, SimulationError> {
        let name = self.name;
        serde_json::from_str(&self.end()?)
            .map_err(|source| SimulationError::Report { name, source })
    }
}

#[cfg(test)]
mod tests {
    use tactnet_serving::ServeReport;

    use super::*;

    fn printing(text: &str) -> ChildProcess {
        // Like the service, it prints the report when it is asked to end.
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
    fn a_child_that_does_not_get_ready_says_why_and_whose_mistake_it_is() {
        for (code, usage) in [(2, true), (1, false)] {
            let script = format!("echo 'error: no hub' >&2; exit {code}");
            let arguments = ["-c", script.as_str()];
            let table = Path::new("table");
            let started = ChildProcess::start(Path::new("/bin/sh"), "skin", &arguments, table);
            let error = started.err().unwrap();
            assert_eq!(error.to_string(), "the skin did not start: no hub");
            assert_eq!(error.is_usage(), usage, "exit code {code}");
        }
    }
}
