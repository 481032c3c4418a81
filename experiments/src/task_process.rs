//! Tasks as a process: one, or several networks that are trained at once.

use std::fs::File;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Instant;

use tactnet_process::ChildProcess;

use crate::tasks::ExperimentDir;
use crate::{ExperimentError, LocalPool, Task};

/// A process that works on tasks; when this is dropped, the process is killed and the tasks are no longer claimed.
pub(crate) struct TaskProcess {
    process: ChildProcess,
    begun: Instant,
    interrupted: bool,
    _claims: Vec<File>,
}

impl TaskProcess {
    /// Starts `program task DIR ID …`, on those of `tasks` that no other runner has, and returns it with their places among `tasks`; `None`
    /// while another runner has the first. What it says goes to the log of the first.
    ///
    /// # Errors
    /// The program cannot be started; a task's log cannot be written.
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
        // Ctrl-C on a terminal reaches the runner alone, which passes it on once.
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

    /// Returns its status once it has ended.
    ///
    /// # Errors
    /// The system does not tell.
    pub(crate) fn status(&mut self) -> Result<Option<ExitStatus>, ExperimentError> {
        self.process
            .ended()
            .map_err(|error| ExperimentError::io(Path::new("task"), "wait for", error))
    }

    /// Time since it was started, seconds.
    pub(crate) fn seconds(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// Asks it, once, to stop where it can be resumed: a second signal would end it at once, without a checkpoint.
    pub(crate) fn interrupt(&mut self) {
        if !self.interrupted {
            self.interrupted = true;
            // One that cannot be asked goes on to its end.
            let _ = self.process.ask_to_end();
        }
    }
}

/// The right to run a task, or `None` while another runner has it.
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
