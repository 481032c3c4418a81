//! Processes that report when they are ready, and whose output is collected.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::last_lines::{last_lines, without_prefix};
use crate::{ChildProcess, ProcessError};

/// First line of a process that is ready.
const READY: &str = "ready";
/// Maximum time between the end of a process's output and its exit.
const ENDING: Duration = Duration::from_secs(1);
/// Interval between two checks of the exit status.
const POLL: Duration = Duration::from_millis(2);

/// Process whose first line is `ready`. It gets SIGTERM when the thread that started it ends (on Linux), and is killed
/// when the value is dropped.
#[derive(Debug)]
pub struct ReadyProcess {
    process: ChildProcess,
    /// Standard output until the process is ready.
    output: Option<BufReader<ChildStdout>>,
    /// Thread that reads the output after `ready`, so that the process never blocks.
    printed: Option<JoinHandle<String>>,
    /// Thread that reads standard error, so that the process never blocks; it returns the last lines.
    said: Option<JoinHandle<String>>,
}

impl ReadyProcess {
    /// Starts `command` without input.
    ///
    /// # Errors
    /// A process that cannot be started.
    pub fn start(command: &mut Command) -> Result<Self, ProcessError> {
        Ok(Self::spawn(command.stdin(Stdio::null()))?.0)
    }

    /// Starts `command` and writes `line` to its standard input.
    ///
    /// # Errors
    /// A process that cannot be started.
    pub fn start_with_input(command: &mut Command, line: &str) -> Result<Self, ProcessError> {
        let (process, input) = Self::spawn(command.stdin(Stdio::piped()))?;
        if let Some(mut input) = input {
            // A process that takes no input reports its error later.
            let _ = writeln!(input, "{line}");
        }
        Ok(process)
    }

    fn spawn(command: &mut Command) -> Result<(Self, Option<ChildStdin>), ProcessError> {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut process = ChildProcess::start(command).map_err(ProcessError::Start)?;
        let (input, output, errors) = process.take_pipes();
        let process = Self {
            process,
            output: output.map(BufReader::new),
            printed: None,
            said: errors.map(|errors| std::thread::spawn(move || last_lines(errors))),
        };
        Ok((process, input))
    }

    /// Waits until the process is ready, and kills it if it prints another line.
    ///
    /// # Errors
    /// A first line other than `ready`.
    pub fn wait_until_ready(&mut self) -> Result<(), ProcessError> {
        let Some(mut output) = self.output.take() else {
            return Ok(());
        };
        let mut line = String::new();
        output.read_line(&mut line)?;
        if line.trim_end() != READY {
            let (status, said) = match line.trim() {
                "" => (self.ended_soon()?, self.last_lines()),
                line => (None, without_prefix(line).into()),
            };
            return Err(ProcessError::NotReady { status, said });
        }
        self.printed = Some(std::thread::spawn(move || {
            let mut printed = String::new();
            // Bytes that are not UTF-8 cannot be `ready`.
            let _ = output.read_to_string(&mut printed);
            printed
        }));
        Ok(())
    }

    /// Returns the exit status of a process that has closed its output; kills it if it does not end within a second.
    fn ended_soon(&mut self) -> Result<Option<ExitStatus>, ProcessError> {
        let begun = Instant::now();
        while begun.elapsed() < ENDING {
            if let Some(status) = self.ended()? {
                return Ok(Some(status));
            }
            std::thread::sleep(POLL);
        }
        self.process.kill();
        Ok(None)
    }

    /// Returns the process id.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Returns the last lines of standard error of a process that has ended; empty the second time.
    pub fn last_words(&mut self) -> String {
        self.last_lines()
    }

    /// Returns the exit status if the process has ended by itself.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn ended(&mut self) -> Result<Option<ExitStatus>, ProcessError> {
        Ok(self.process.ended()?)
    }

    /// Sends SIGTERM and returns the output after `ready`.
    ///
    /// # Errors
    /// An exit status other than success.
    pub fn end(mut self) -> Result<String, ProcessError> {
        self.process.ask_to_end()?;
        let status = self.process.wait()?;
        if !status.success() {
            let said = self.last_lines();
            return Err(ProcessError::Failed { status, said });
        }
        Ok(self.printed.take().map(joined).unwrap_or_default())
    }

    /// Returns the last lines of standard error once the process has ended; empty the second time.
    fn last_lines(&mut self) -> String {
        self.said.take().map(joined).unwrap_or_default()
    }
}

fn joined(thread: JoinHandle<String>) -> String {
    let text = thread.join();
    text.unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;

    fn script(text: &str) -> Command {
        let mut command = Command::new("/bin/sh");
        command.args(["-c", text]);
        command
    }

    fn ready(text: &str) -> ReadyProcess {
        let mut process = ReadyProcess::start(&mut script(text)).unwrap();
        process.wait_until_ready().unwrap();
        process
    }

    #[test]
    fn what_is_printed_on_the_way_out_is_returned() {
        let process = ready(
            "bye() { echo bye; exit 0; }; trap bye TERM; echo ready; while :; do sleep 0.01; done",
        );
        assert_eq!(process.end().unwrap(), "bye\n");
    }

    #[test]
    fn a_process_that_fails_says_why_in_its_last_lines() {
        let process = ready(
            "bye() { echo why >&2; exit 3; }; trap bye TERM; echo ready; while :; do sleep 0.01; done",
        );
        let error = process.end().unwrap_err().to_string();
        assert_eq!(error, "ended with exit status: 3: why");
    }

    #[test]
    fn a_process_that_is_not_ready_says_why_on_either_stream() {
        for text in [
            "echo 'error: no hub' >&2; exit 2",
            "echo 'no hub' >&2; exit 1",
            "echo 'error: no hub'; exec sleep 60",
        ] {
            let mut process = ReadyProcess::start(&mut script(text)).unwrap();
            let error = process.wait_until_ready().unwrap_err();
            assert_eq!(error.to_string(), "did not start: no hub");
            assert_eq!(error.is_usage(), text.ends_with("exit 2"));
        }
    }

    #[test]
    fn input_comes_before_ready() {
        let mut reads = script("read line; [ \"$line\" = task ] && echo ready");
        let mut process = ReadyProcess::start_with_input(&mut reads, "task").unwrap();
        process.wait_until_ready().unwrap();
    }
}
