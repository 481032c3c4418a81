//! A process that says when it is ready, and is asked for what it printed.

use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, ChildStdout, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::last_lines::{last_lines, without_prefix};
use crate::{ChildProcess, ProcessError};

/// The first line of a process that is ready.
const READY: &str = "ready";
/// How long a process may take to end after it has closed its output.
const ENDING: Duration = Duration::from_secs(1);
/// How often it is looked at meanwhile.
const POLL: Duration = Duration::from_millis(2);

/// A process whose first line is `ready`. It gets SIGTERM when the thread that started it ends (on Linux), and is killed when this is
/// dropped.
#[derive(Debug)]
pub struct ReadyProcess {
    process: ChildProcess,
    /// Until it is ready.
    output: Option<BufReader<ChildStdout>>,
    /// Reads what it prints afterwards, so that it never waits for us.
    printed: Option<JoinHandle<String>>,
    /// Reads its standard error, for the same reason; ends with the last lines.
    said: Option<JoinHandle<String>>,
}

impl ReadyProcess {
    /// Starts `command` without input.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(command: &mut Command) -> Result<Self, ProcessError> {
        Ok(Self::spawn(command.stdin(Stdio::null()))?.0)
    }

    /// Starts `command` and writes `line` to its standard input.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start_with_input(command: &mut Command, line: &str) -> Result<Self, ProcessError> {
        let (process, input) = Self::spawn(command.stdin(Stdio::piped()))?;
        if let Some(mut input) = input {
            // One that takes no input says why when it is waited for.
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

    /// Waits until it is ready; it is killed if it says anything else.
    ///
    /// # Errors
    /// Its first line is not `ready`.
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
            // What is no text is not ours.
            let _ = output.read_to_string(&mut printed);
            printed
        }));
        Ok(())
    }

    /// Returns the status of a process that has closed its output, and kills it if it does not end within a second.
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

    /// Returns its number.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// Returns what one that has ended by itself said last on its standard error; no text the second time.
    pub fn last_words(&mut self) -> String {
        self.last_lines()
    }

    /// Returns its status if it has ended by itself.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn ended(&mut self) -> Result<Option<ExitStatus>, ProcessError> {
        Ok(self.process.ended()?)
    }

    /// Asks it to end and returns what it printed after `ready`.
    ///
    /// # Errors
    /// It ended with another status than success.
    pub fn end(mut self) -> Result<String, ProcessError> {
        self.process.ask_to_end()?;
        let status = self.process.wait()?;
        if !status.success() {
            let said = self.last_lines();
            return Err(ProcessError::Failed { status, said });
        }
        Ok(self.printed.take().map(joined).unwrap_or_default())
    }

    /// Returns the last lines of its standard error once it has ended; no text the second time.
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
