//! A task as a process.

use std::fs::File;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};
use std::time::Instant;

use tactnet_process::ChildProcess;

use crate::tasks::ExperimentDir;
use crate::{ExperimentError, Task};

/// A process that works on a task; when this is dropped, the process is killed and the task is no longer claimed.
pub(crate) struct TaskProcess {
    process: ChildProcess,
    begun: Instant,
    interrupted: bool,
    _claim: File,
}

impl TaskProcess {
    /// Starts `program task DIR ID`, or `None` while another runner has the task.
    ///
    /// # Errors
    /// The program cannot be started; the task's log cannot be written.
    pub(crate) fn start(
        dir: &ExperimentDir,
        program: &Path,
        task: &Task,
        threads: usize,
    ) -> Result<Option<Self>, ExperimentError> {
        let Some(claim) = claim(dir, task)? else {
            return Ok(None);
        };
        let path = dir.log_file(task);
        let log = File::options()
            .create(true)
            .append(true)
            .open(&path)
            .map_err(|error| ExperimentError::io(&path, "write", error))?;
        let mut command = Command::new(program);
        command
            .arg("task")
            .arg(dir.path())
            .arg(&task.id)
            .env("RAYON_NUM_THREADS", threads.to_string())
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log);
        // Ctrl-C on a terminal reaches the runner alone, which passes it on once.
        let process = ChildProcess::start(&mut command)
            .map_err(|error| ExperimentError::io(program, "start", error))?;
        Ok(Some(Self {
            process,
            begun: Instant::now(),
            interrupted: false,
            _claim: claim,
        }))
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
