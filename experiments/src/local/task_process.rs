//! Child processes that run one task, or train several networks together.

use std::fs::File;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Instant;

use tactnet_process::ChildProcess;

use super::LocalPool;
use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Task};

/// A process that runs tasks. Dropping it kills the process and releases the tasks.
pub(crate) struct TaskProcess {
    process: ChildProcess,
    begun: Instant,
    interrupted: bool,
    _claims: Vec<File>,
}

impl TaskProcess {
    /// Starts `program task DIR ID …` for those of `tasks` that no other runner has claimed.
    ///
    /// Returns the process and the positions of its tasks in `tasks`, or `None` if another runner has claimed the
    /// first. Its stderr is appended to the log of the first task.
    ///
    /// # Errors
    /// A program that cannot be started; a log that cannot be written.
    pub(crate) fn start(
        dir: &ExperimentDir,
        program: &Path,
        tasks: &[&Task],
        pool: LocalPool,
    ) -> Result<Option<(Self, Vec<usize>)>, ExperimentError> {
        let mut claims = Vec::new();
        let mut claimed = Vec::new();
        for (place, task) in tasks.iter().enumerate() {
            match claim(dir, task)? {
                Some(claim) => {
                    claims.push(claim);
                    claimed.push(place);
                }
                None if place == 0 => return Ok(None),
                None => {}
            }
        }
        let first = tasks[0];
        for &place in &claimed[1..] {
            dir.note(tasks[place], &format!("trained at once with {}", first.id))?;
        }
        let path = dir.log_file(first);
        let log = File::options()
            .create(true)
            .append(true)
            .open(&path)
            .map_err(|error| ExperimentError::io(&path, "write", error))?;
        let mut command = Command::new(program);
        command.arg("task");
        if let Some(at_once) = pool.at_once {
            command.arg("--at-once").arg(at_once.to_string());
        }
        command
            .arg(dir.path())
            .args(claimed.iter().map(|&place| &tasks[place].id))
            .env("RAYON_NUM_THREADS", pool.threads.to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log);
        // Ctrl-C on a terminal only reaches the runner, which forwards it once.
        let process = ChildProcess::start(&mut command)
            .map_err(|error| ExperimentError::io(program, "start", error))?;
        let started = Self {
            process,
            begun: Instant::now(),
            interrupted: false,
            _claims: claims,
        };
        Ok(Some((started, claimed)))
    }

    /// Returns the exit status, or `None` while the process runs.
    ///
    /// # Errors
    /// A status that the system does not report.
    pub(crate) fn status(&mut self) -> Result<Option<ExitStatus>, ExperimentError> {
        self.process
            .ended()
            .map_err(|error| ExperimentError::io(Path::new("task"), "wait for", error))
    }

    /// Returns the time since the start, in seconds.
    pub(crate) fn seconds(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Asks the process once to stop where it can be resumed. A second signal would end it immediately, without a
    /// checkpoint.
    pub(crate) fn interrupt(&mut self) {
        if !self.interrupted {
            self.interrupted = true;
            // A process that cannot be signalled runs to its end.
            let _ = self.process.ask_to_end();
        }
    }
}

/// Claims a task; `None` if another runner has claimed it.
fn claim(dir: &ExperimentDir, task: &Task) -> Result<Option<File>, ExperimentError> {
    let path = dir.path().join("tasks").join(format!("{}.claim", task.id));
    let failed = |error| ExperimentError::io(&path, "claim", error);
    let file = File::options()
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path)
        .map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(std::fs::TryLockError::WouldBlock) => Ok(None),
        Err(std::fs::TryLockError::Error(error)) => Err(failed(error)),
    }
}
