//! Runs tasks on this machine: a bounded pool of processes that share its cores.

use std::fs::File;
#[cfg(unix)]
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::tasks::{ExperimentDir, TaskState};
use crate::{Event, ExperimentError, Task};

/// How often processes are looked at.
const POLL: Duration = Duration::from_millis(50);
/// How often a task is begun before it counts as failed.
const ATTEMPTS: usize = 3;
/// Exit code of a task that would fail again the same way: its call must be corrected.
const HOPELESS: i32 = 2;

/// A bounded pool of processes.
#[derive(Debug, Clone, Copy)]
pub struct LocalPool {
    /// Tasks that run at once.
    pub jobs: usize,
    /// Threads of each.
    pub threads: usize,
}

impl LocalPool {
    /// One task for every core, so that no core waits for another, but no more than there are `tasks`.
    ///
    /// On two cores, two trainings side by side end 12 % sooner than one after the other on both.
    pub fn for_cores(cores: usize, tasks: usize) -> Self {
        Self::with_jobs(cores.min(tasks), cores)
    }

    /// `jobs` at once, sharing `cores`.
    pub fn with_jobs(jobs: usize, cores: usize) -> Self {
        Self {
            jobs: jobs.max(1),
            threads: (cores / jobs.max(1)).max(1),
        }
    }
}

/// A task that runs.
struct Running<'a> {
    task: &'a Task,
    index: usize,
    child: Child,
    begun: Instant,
    /// Held while this runner works on the task, so that two runners on one folder share the work.
    _claim: File,
}

/// Runs every task that has not ended; tasks on which another process works are waited for.
///
/// - `program`: the `tactnet` binary
/// - `stop`: asked often; once true, running tasks are told to stop where they can be resumed, and no more are begun
/// - `tell`: what happens
///
/// # Errors
/// Tasks that failed three times, once all others have ended; a folder that cannot be written.
pub fn run_locally(
    dir: &ExperimentDir,
    program: &Path,
    pool: LocalPool,
    stop: impl Fn() -> bool,
    mut tell: impl FnMut(Event<'_>),
) -> Result<(), ExperimentError> {
    let tasks = &dir.plan.tasks;
    let mut attempts = vec![0; tasks.len()];
    let mut ended: Vec<bool> = tasks
        .iter()
        .map(|t| dir.state(t) == TaskState::Done)
        .collect();
    let mut running: Vec<Running<'_>> = Vec::new();
    let mut told_to_stop = false;
    tell(Event::Begun {
        done: ended.iter().filter(|ended| **ended).count(),
        all: tasks.len(),
    });
    loop {
        let stopping = stop();
        if stopping && !told_to_stop {
            // Once: a second signal would end a task at once, without a checkpoint.
            running.iter().for_each(|r| interrupt(&r.child));
            told_to_stop = true;
        }
        let mut position = 0;
        while position < running.len() {
            let status = running[position]
                .child
                .try_wait()
                .map_err(|error| ExperimentError::io(program, "wait for", error))?;
            let Some(status) = status else {
                position += 1;
                continue;
            };
            let Running {
                task, index, begun, ..
            } = running.swap_remove(position);
            if dir.state(task) == TaskState::Done {
                ended[index] = true;
                tell(Event::Done {
                    task,
                    seconds: begun.elapsed().as_secs_f64(),
                });
            } else if !stopping {
                attempts[index] += 1;
                if status.code() == Some(HOPELESS) {
                    attempts[index] = ATTEMPTS;
                }
                tell(Event::Failed {
                    task,
                    attempt: attempts[index],
                    reason: dir.last_words(task),
                });
                ended[index] = attempts[index] >= ATTEMPTS;
            }
        }
        if stopping && running.is_empty() {
            return Ok(());
        }
        let mut open = (0..tasks.len())
            .filter(|&i| !ended[i] && running.iter().all(|r| r.index != i))
            .collect::<Vec<_>>()
            .into_iter();
        while !stopping && running.len() < pool.jobs {
            let Some(index) = open.next() else { break };
            let task = &tasks[index];
            match dir.state(task) {
                TaskState::Done => {
                    ended[index] = true;
                    tell(Event::Done { task, seconds: 0.0 });
                }
                TaskState::Running => {}
                TaskState::Open | TaskState::Interrupted => {
                    if let Some(claim) = claim(dir, task)? {
                        let child = start(dir, program, task, pool.threads)?;
                        tell(Event::Started { task });
                        running.push(Running {
                            task,
                            index,
                            child,
                            begun: Instant::now(),
                            _claim: claim,
                        });
                    }
                }
            }
        }
        if ended.iter().all(|ended| *ended) {
            break;
        }
        thread::sleep(POLL);
    }
    failures(dir)
}

/// An error if a task has not ended well.
pub(crate) fn failures(dir: &ExperimentDir) -> Result<(), ExperimentError> {
    let tasks = &dir.plan.tasks;
    let failed: Vec<&Task> = tasks
        .iter()
        .filter(|t| dir.state(t) != TaskState::Done)
        .collect();
    match failed.first() {
        None => Ok(()),
        Some(first) => Err(ExperimentError::Tasks {
            count: failed.len(),
            all: tasks.len(),
            first: first.id.clone(),
            reason: dir.last_words(first),
        }),
    }
}

/// Runs one task until it ends: what a Slurm job does.
///
/// - `stop`: asked often; once true, the task is told to stop where it can be resumed
///
/// # Errors
/// The task cannot be started or does not end well; another process works on it.
pub fn run_task(
    dir: &ExperimentDir,
    program: &Path,
    index: usize,
    threads: usize,
    stop: impl Fn() -> bool,
) -> Result<(), ExperimentError> {
    let Some(task) = dir.plan.tasks.get(index) else {
        return Err(ExperimentError::Folder {
            path: dir.path().into(),
            reason: format!(
                "has {} tasks, none has number {index}",
                dir.plan.tasks.len()
            ),
        });
    };
    if dir.state(task) == TaskState::Done {
        return Ok(());
    }
    let failed = |reason: String| ExperimentError::Tasks {
        count: 1,
        all: 1,
        first: task.id.clone(),
        reason,
    };
    let Some(_claim) = claim(dir, task)? else {
        return Err(failed("another process works on it".into()));
    };
    let mut child = start(dir, program, task, threads)?;
    let mut told_to_stop = false;
    loop {
        let ended = child
            .try_wait()
            .map_err(|error| ExperimentError::io(program, "wait for", error))?;
        if ended.is_some() {
            break;
        }
        if stop() && !told_to_stop {
            interrupt(&child);
            told_to_stop = true;
        }
        thread::sleep(POLL);
    }
    match dir.state(task) {
        TaskState::Done => Ok(()),
        _ => Err(failed(dir.last_words(task))),
    }
}

/// The right to run a task, or `None` while another runner has it.
fn claim(dir: &ExperimentDir, task: &Task) -> Result<Option<File>, ExperimentError> {
    let path = dir.path().join("tasks").join(format!("{}.claim", task.id));
    let failed = |error| ExperimentError::io(&path, "claim", error);
    let file = File::create(&path).map_err(failed)?;
    match file.try_lock() {
        Ok(()) => Ok(Some(file)),
        Err(std::fs::TryLockError::WouldBlock) => Ok(None),
        Err(std::fs::TryLockError::Error(error)) => Err(failed(error)),
    }
}

fn start(
    dir: &ExperimentDir,
    program: &Path,
    task: &Task,
    threads: usize,
) -> Result<Child, ExperimentError> {
    let arguments = dir.arguments(task)?;
    let path = dir.log_file(task);
    let log = File::options()
        .create(true)
        .append(true)
        .open(&path)
        .map_err(|error| ExperimentError::io(&path, "write", error))?;
    let mut command = Command::new(program);
    command
        .args(arguments)
        .env("RAYON_NUM_THREADS", threads.to_string())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(log);
    // Ctrl-C on a terminal reaches the runner alone, which passes it on once.
    #[cfg(unix)]
    command.process_group(0);
    command
        .spawn()
        .map_err(|error| ExperimentError::io(program, "start", error))
}

/// Asks a process to stop where it can be resumed.
#[cfg(unix)]
fn interrupt(child: &Child) {
    let pid = child.id().to_string();
    let _ = Command::new("kill").args(["-TERM", &pid]).status();
}

#[cfg(not(unix))]
fn interrupt(_: &Child) {}
