//! Runs tasks on this machine in a bounded pool of processes that share its cores.

mod task_process;

use std::path::Path;
use std::thread;
use std::time::Duration;

use tactnet_data::Seed;
use tactnet_models::Compute;
use tactnet_pipeline::TrainSpec;

use crate::tasks::{ExperimentDir, TaskState, is_about_disk};
use crate::{Event, ExperimentError, Job, Task, TimeLeft};
use task_process::TaskProcess;

/// Interval between two checks of the running processes.
const POLL: Duration = Duration::from_millis(50);
/// Maximum number of attempts for each task.
const ATTEMPTS: usize = 3;
/// Maximum number of networks that one process trains together; the GPU's memory may reduce it.
const TOGETHER: usize = 100;
/// Exit code of a task that would fail again in the same way, because its call is wrong.
const HOPELESS: i32 = 2;

/// A bounded pool of processes.
#[derive(Debug, Clone, Copy)]
pub struct LocalPool {
    /// Maximum number of tasks that run at the same time.
    pub jobs: usize,
    /// Number of threads for each task.
    pub threads: usize,
    /// Number of networks that a GPU trains together; `None` for as many as its memory allows.
    pub at_once: Option<usize>,
}

impl LocalPool {
    /// Returns a pool of one task for each core, but at most `tasks`.
    ///
    /// On two cores, two trainings side by side finish 12 % sooner than one after the other on both cores.
    pub fn for_cores(cores: usize, tasks: usize) -> Self {
        Self::with_jobs(cores.min(tasks), cores)
    }

    /// Returns a pool of `jobs` parallel tasks that share `cores`.
    pub fn with_jobs(jobs: usize, cores: usize) -> Self {
        Self {
            jobs: jobs.max(1),
            threads: (cores / jobs.max(1)).max(1),
            at_once: None,
        }
    }

    /// Sets the number of networks that a GPU trains together.
    #[must_use]
    pub fn at_once(self, at_once: Option<usize>) -> Self {
        Self { at_once, ..self }
    }
}

/// A process that runs one task, or trains several networks together on a GPU.
struct Running {
    indices: Vec<usize>,
    process: TaskProcess,
}

/// Returns the settings that networks must share to be trained together on a GPU; `None` for all other tasks.
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

/// Returns up to `most` tasks of `open` that can be trained together with `first`, which comes first.
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

/// Runs all unfinished tasks and waits for tasks that another process runs.
///
/// - `program`: the `tactnet` binary
/// - `stop`: polled often; once it returns true, running tasks stop where they can be resumed, and no new task starts
/// - `tell`: receives progress events
///
/// # Errors
/// Tasks that failed three times, after all others have finished; a folder that cannot be written; a full disk, at once.
pub fn run_locally(
    dir: &ExperimentDir,
    program: &Path,
    pool: LocalPool,
    stop: impl Fn() -> bool,
    mut tell: impl FnMut(Event<'_>),
) -> Result<(), ExperimentError> {
    let tasks = &dir.plan.tasks;
    let is_done = |task| dir.state(task) == TaskState::Done;
    let mut runner = Runner {
        dir,
        program,
        pool,
        attempts: vec![0; tasks.len()],
        ended: tasks.iter().map(is_done).collect(),
        running: Vec::new(),
    };
    tell(Event::Begun {
        done: runner.ended.iter().filter(|ended| **ended).count(),
        all: tasks.len(),
        left: TimeLeft::of(dir, pool.jobs),
    });
    loop {
        let stopping = stop();
        if stopping {
            let running = runner.running.iter_mut();
            running.for_each(|running| running.process.interrupt());
        }
        runner.collect(stopping, &mut tell)?;
        if stopping {
            if runner.running.is_empty() {
                return Ok(());
            }
        } else {
            runner.start(&mut tell)?;
        }
        if runner.ended.iter().all(|ended| *ended) {
            break;
        }
        thread::sleep(POLL);
    }
    failures(dir)
}

/// The state of [`run_locally`].
struct Runner<'a> {
    dir: &'a ExperimentDir,
    program: &'a Path,
    pool: LocalPool,
    /// Number of failures of each task.
    attempts: Vec<usize>,
    /// True for tasks that are finished or have failed finally.
    ended: Vec<bool>,
    running: Vec<Running>,
}

impl Runner<'_> {
    /// Removes the processes that have ended, and reports their tasks.
    fn collect(
        &mut self,
        stopping: bool,
        tell: &mut impl FnMut(Event<'_>),
    ) -> Result<(), ExperimentError> {
        let mut position = 0;
        while position < self.running.len() {
            let Some(status) = self.running[position].process.status()? else {
                position += 1;
                continue;
            };
            let Running { indices, process } = self.running.swap_remove(position);
            for &index in &indices {
                let task = &self.dir.plan.tasks[index];
                if self.dir.state(task) == TaskState::Done {
                    self.ended[index] = true;
                    let seconds = process.seconds() / indices.len() as f64;
                    tell(Event::Done { task, seconds });
                } else if !stopping {
                    let reason = self.dir.last_log_line(task);
                    if is_about_disk(&reason) {
                        return Err(ExperimentError::DiskFull {
                            path: self.dir.path().into(),
                            first: task.id.clone(),
                            reason,
                        });
                    }
                    self.attempts[index] += 1;
                    // With several tasks in a process, the wrong call cannot be attributed to one of them.
                    if status.code() == Some(HOPELESS) && indices.len() == 1 {
                        self.attempts[index] = ATTEMPTS;
                    }
                    tell(Event::Failed {
                        task,
                        attempt: self.attempts[index],
                        reason,
                    });
                    self.ended[index] = self.attempts[index] >= ATTEMPTS;
                }
            }
        }
        Ok(())
    }

    /// Returns true for a committee with members that have not ended.
    fn waits(&self, index: usize) -> bool {
        let tasks = &self.dir.plan.tasks;
        let members = &tasks[index].members;
        let has_ended = |id: &String| {
            let member = tasks.iter().position(|task| task.id == *id);
            member.is_none_or(|member| self.ended[member])
        };
        !members.iter().all(has_ended)
    }

    /// Starts tasks while the pool has room.
    fn start(&mut self, tell: &mut impl FnMut(Event<'_>)) -> Result<(), ExperimentError> {
        let is_running = |i: &usize| self.running.iter().any(|r| r.indices.contains(i));
        let mut open: Vec<usize> = (0..self.ended.len())
            .filter(|i| !self.ended[*i] && !is_running(i) && !self.waits(*i))
            .collect();
        while self.running.len() < self.pool.jobs && !open.is_empty() {
            let index = open.remove(0);
            let task = &self.dir.plan.tasks[index];
            match self.dir.state(task) {
                TaskState::Done => {
                    self.ended[index] = true;
                    tell(Event::Done { task, seconds: 0.0 });
                }
                TaskState::Running => {}
                TaskState::Open | TaskState::Interrupted => {
                    self.start_group(index, &mut open, tell)?;
                }
            }
        }
        Ok(())
    }

    /// Starts a process for a task and for those of `open` that can be trained together with it.
    fn start_group(
        &mut self,
        index: usize,
        open: &mut Vec<usize>,
        tell: &mut impl FnMut(Event<'_>),
    ) -> Result<(), ExperimentError> {
        let (dir, tasks) = (self.dir, &self.dir.plan.tasks);
        // A task that has failed is retried alone.
        let fresh = |i: &usize| {
            let state = dir.state(&tasks[*i]);
            let waits = matches!(state, TaskState::Open | TaskState::Interrupted);
            self.attempts[*i] == 0 && waits
        };
        let others: Vec<usize> = open.iter().copied().filter(fresh).collect();
        let most = match self.attempts[index] {
            0 => self.pool.at_once.unwrap_or(TOGETHER),
            _ => 1,
        };
        let group = together(dir, index, &others, most);
        let of_group: Vec<&Task> = group.iter().map(|&i| &tasks[i]).collect();
        let started = TaskProcess::start(dir, self.program, &of_group, self.pool)?;
        if let Some((process, claimed)) = started {
            let indices: Vec<usize> = claimed.iter().map(|&at| group[at]).collect();
            open.retain(|i| !indices.contains(i));
            for &index in &indices {
                let task = &tasks[index];
                tell(Event::Started { task });
            }
            self.running.push(Running { indices, process });
        }
        Ok(())
    }
}

/// Returns an error if any task is unfinished.
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
            reason: dir.last_log_line(first),
        }),
    }
}

/// Runs one task to its end, as a Slurm job does.
///
/// - `stop`: polled often; once it returns true, the task stops where it can be resumed
///
/// # Errors
/// A task that cannot be started or fails; a task that another process runs.
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
        _ => Err(failed(dir.last_log_line(task))),
    }
}
