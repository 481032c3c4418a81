//! The `tactnet` command as a process beside this one, for commands that run several at once.

use std::path::Path;
use std::process::{Command, ExitStatus};

use tactnet_process::ReadyProcess;

use crate::SimulationError;

/// A process with a role; it is killed if this is dropped before [`ChildProcess::end`].
pub struct ChildProcess {
    name: &'static str,
    process: ReadyProcess,
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

    /// Returns its role.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Returns its status if it has ended by itself.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn ended(&mut self) -> Result<Option<ExitStatus>, SimulationError> {
        let ended = self.process.ended();
        ended.map_err(|error| SimulationError::process(self.name, &error))
    }

    /// Asks it to end and returns what it printed.
    ///
    /// # Errors
    /// It ended with another status than success.
    pub fn end(self) -> Result<String, SimulationError> {
        let ended = self.process.end();
        ended.map_err(|error| SimulationError::process(self.name, &error))
    }

    /// Asks it to end and returns the report that it printed as one JSON document.
    ///
    /// # Errors
    /// As [`ChildProcess::end`]; another document than a `T`.
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
