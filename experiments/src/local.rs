//! Runs tasks on this machine: a bounded pool of processes that share its cores.

use std::path::Path;
use std::thread;
use std::time::Duration;

use tactnet_data::Seed;
use tactnet_models::Compute;
use tactnet_pipeline::TrainSpec;

use crate::task_process::TaskProcess;
use crate::tasks::{ExperimentDir, TaskState};
use crate::{Event, ExperimentError, Job, Task, TimeLeft};

/// How often processes are looked at.
const POLL: Duration = Duration::from_millis(50);
/// How often a task is begun before it counts as failed.
const ATTEMPTS: usize = 3;
/// Networks that one process is given at once, at most; it trains as many of them side by side as memory allows.
const TOGETHER: usize = 100;
/// Exit code of a task that would fail again the same way: its call must be corrected.
const HOPELESS: i32 = 2;

/// A bounded pool of processes.
#[derive(Debug, Clone, Copy)]
pub struct LocalPool {
    /// Tasks that run at once.
    pub jobs: usize,
    /// Threads of each.
    pub threads: usize,
    /// Networks that a GPU trains at once; `None`: as many as its memory allows.
    pub at_once: Option<usize>,
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
            at_once: None,
        }
    }

    /// With so many networks at once on a GPU.
    #[must_use]
    pub fn at_once(self, at_once: Option<usize>) -> Self {
        Self { at_once, ..self }
    }
}

/// A process that works on tasks: one, or several networks that a GPU trains at once.
struct Running {
    indices: Vec<usize>,
    process: TaskProcess,
}

/// What is the same of networks that a GPU can train at once; `None` of all other tasks.
fn kind(dir: &ExperimentDir, task: &Task) -> Option<TrainSpec> {
    let Job::Train(spec) = &task.job else {
        return None;
    };
    let alone = spec.device == Compute::Cpu || spec.watch_test || !dir.plan.trains_network(task);
    (!alone).then(|| TrainSpec {
        fold: None,
        repeat: 0,
        inner: None,
        seed: Seed(0),
        ..spec.clone()
    })
}

/// The tasks of `open` that the one at `first` can be trained with at once, that one in front.
fn together(dir: &ExperimentDir, first: usize, open: &[usize], most: usize) -> Vec<usize> {
    let tasks = &dir.plan.tasks;
    let mut group = vec![first];
    if let Some(own) = kind(dir, &tasks[first]).filter(|_| most > 1) {
        let others = open.iter().copied().filter(|&other| {
            other != first && kind(dir, &tasks[other]).is_some_and(|kind| kind == own)
        });
        group.extend(others.take(most - 1));
    }
    group
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
    let mut running: Vec<Running> = Vec::new();
    tell(Event::Begun {
        done: ended.iter().filter(|ended| **ended).count(),
        all: tasks.len(),
        left: TimeLeft::of(dir, pool.jobs),
    });
    loop {
        let stopping = stop();
        if stopping {
            running.iter_mut().for_each(|r| r.process.interrupt());
        }
        let mut position = 0;
        while position < running.len() {
            let Some(status) = running[position].process.status()? else {
                position += 1;
                continue;
            };
            let Running { indices, process } = running.swap_remove(position);
            for &index in &indices {
                let task = &tasks[index];
                if dir.state(task) == TaskState::Done {
                    ended[index] = true;
                    tell(Event::Done {
                        task,
                        seconds: process.seconds() / indices.len() as f64,
                    });
                } else if !stopping {
                    attempts[index] += 1;
                    // Of several, nobody knows whose call it is.
                    if status.code() == Some(HOPELESS) && indices.len() == 1 {
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
        }
        if stopping && running.is_empty() {
            return Ok(());
        }
        let mut open: Vec<usize> = (0..tasks.len())
            .filter(|i| !ended[*i] && running.iter().all(|r| !r.indices.contains(i)))
            .collect();
        while !stopping && running.len() < pool.jobs && !open.is_empty() {
            let index = open.remove(0);
            let task = &tasks[index];
            match dir.state(task) {
                TaskState::Done => {
                    ended[index] = true;
                    tell(Event::Done { task, seconds: 0.0 });
                }
                TaskState::Running => {}
                TaskState::Open | TaskState::Interrupted => {
                    // What has failed is tried again alone.
                    let fresh = |i: &usize| {
                        let state = dir.state(&tasks[*i]);
                        let waits = matches!(state, TaskState::Open | TaskState::Interrupted);
                        attempts[*i] == 0 && waits
                    };
                    let others: Vec<usize> = open.iter().copied().filter(fresh).collect();
                    let most = match attempts[index] {
                        0 => pool.at_once.unwrap_or(TOGETHER),
                        _ => 1,
                    };
                    let mut group = together(dir, index, &others, most);
                    let of_group: Vec<&Task> = group.iter().map(|&i| &tasks[i]).collect();
                    let started = TaskProcess::start(dir, program, &of_group, pool)?;
                    if let Some((process, claimed)) = started {
                        group = claimed.iter().map(|&at| group[at]).collect();
                        open.retain(|i| !group.contains(i));
                        for &index in &group {
                            tell(Event::Started {
                                task: &tasks[index],
                            });
                        }
                        running.push(Running {
                            indices: group,
                            process,
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
    let pool = LocalPool::with_jobs(1, threads);
    let Some((mut process, _)) = TaskProcess::start(dir, program, &[task], pool)? else {
        return Err(failed("another process works on it".into()));
    };
    while process.status()?.is_none() {
        if stop() {
            process.interrupt();
        }
        thread::sleep(POLL);
    }
    match dir.state(task) {
        TaskState::Done => Ok(()),
        _ => Err(failed(dir.last_words(task))),
    }
}
