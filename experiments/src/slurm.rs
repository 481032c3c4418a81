//! Runs tasks on a cluster: submits a Slurm array job, polls it until it leaves the queue, and resubmits tasks that did not finish.
//!
//! | end of a task | reaction |
//! |---|---|
//! | preempted, node failed | resubmitted; no attempt is used up |
//! | time limit, after a new checkpoint | resubmitted, resumes from the checkpoint; no attempt is used up |
//! | out of memory | resubmitted with twice the memory; given up if the memory is unknown |
//! | disk full | the run stops at once |
//! | other failures | resubmitted, three attempts in all |

mod outcome;
mod queue;
mod submission;

use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use crate::local::failures;
use crate::tasks::{ExperimentDir, TaskState, is_about_disk};
use crate::{Event, ExperimentError, Task, TimeLeft};
use outcome::{Accounted, End, accounted};
use queue::{MAX_REFUSALS, call, in_queue};
use submission::{Submission, find, recorded_tasks, submit};

/// Maximum number of failures of each task.
const ATTEMPTS: usize = 3;

/// Maximum number of interruptions of each task that use up no attempt.
const INTERRUPTIONS: usize = 50;

/// Time that running tasks have for a clean stop.
const GRACE: Duration = Duration::from_secs(60);

/// Settings of Slurm array jobs.
#[derive(Debug, Clone)]
pub struct SlurmArray {
    /// Cores for each task.
    pub cores: usize,
    /// Maximum number of tasks that run at the same time.
    pub jobs: usize,
    /// Additional arguments of `sbatch`, such as a partition.
    pub arguments: Vec<String>,
    /// Interval between two queries of the queue.
    pub poll: Duration,
}

/// Submits all unfinished tasks, waits for them, and resubmits those that did not finish.
///
/// Every node must see the experiment's folder and the program under the same path.
///
/// - `stop`: polled often; once it returns true, the array job is cancelled, and its tasks stop where they can be
///   resumed
///
/// # Errors
/// Missing or failing Slurm programs; tasks that failed three times or ran out of memory; a full disk.
pub fn run_on_slurm(
    dir: &ExperimentDir,
    program: &Path,
    array: &SlurmArray,
    stop: impl Fn() -> bool,
    mut tell: impl FnMut(Event<'_>),
) -> Result<(), ExperimentError> {
    let logs = dir.path().join("slurm");
    std::fs::create_dir_all(&logs).map_err(|error| ExperimentError::io(&logs, "make", error))?;
    let mut run = Run::new(dir, array, logs);
    tell(Event::Begun {
        done: run.standings.iter().filter(|of| of.is_done).count(),
        all: dir.plan.tasks.len(),
        left: TimeLeft::of(dir, array.jobs),
    });
    while let Some(open) = run.next() {
        let checkpoints = run.checkpoints(&open);
        // A job that survived its runner is waited for instead of submitted again.
        let submission = run.submission(program);
        let (job, tasks) = match find(&submission)? {
            Some(job) => (job.clone(), recorded_tasks(&submission, &job)),
            None => (submit(&submission, &open)?, Some(open.clone())),
        };
        let look = || run.report_done(&open, &mut tell);
        if is_stopped(&job, array.poll, &stop, look)? {
            return cancel(&job, array.poll);
        }
        run.report_done(&open, &mut tell);
        // Of a job whose tasks are not known, those without a result are submitted again.
        if let Some(tasks) = tasks {
            let ended = Ended {
                job: &job,
                tasks: &tasks,
                open: &open,
                checkpoints: &checkpoints,
            };
            run.judge(ended, &mut tell)?;
        }
    }
    run.outcome()
}

/// Standing of a task.
#[derive(Debug, Clone, Default)]
struct Standing {
    is_done: bool,
    /// True for a task that would fail again in the same way.
    is_given_up: bool,
    /// Number of failures.
    attempts: usize,
    /// Number of interruptions that were no failures of the task.
    interruptions: usize,
    /// Reason of the last failure; empty without one.
    reason: String,
}

impl Standing {
    fn is_open(&self) -> bool {
        !self.is_done
            && !self.is_given_up
            && self.attempts < ATTEMPTS
            && self.interruptions < INTERRUPTIONS
    }
}

/// A job that has left the queue.
struct Ended<'a> {
    job: &'a str,
    /// Numbers of its tasks.
    tasks: &'a [usize],
    /// Numbers of the tasks that were open before.
    open: &'a [usize],
    /// Last checkpoints of `open` before the job.
    checkpoints: &'a [Option<SystemTime>],
}

/// The state of [`run_on_slurm`].
struct Run<'a> {
    dir: &'a ExperimentDir,
    array: &'a SlurmArray,
    logs: PathBuf,
    standings: Vec<Standing>,
    /// Memory that the next submission asks for, in MiB; `None`: the default of the cluster, or that of the arguments.
    memory_mib: Option<u64>,
}

impl<'a> Run<'a> {
    fn new(dir: &'a ExperimentDir, array: &'a SlurmArray, logs: PathBuf) -> Self {
        let standing = |task| Standing {
            is_done: dir.state(task) == TaskState::Done,
            ..Standing::default()
        };
        Self {
            dir,
            array,
            logs,
            standings: dir.plan.tasks.iter().map(standing).collect(),
            memory_mib: None,
        }
    }

    /// Returns the tasks of the next submission; `None` if none is left. Committees follow once the tasks of their members have ended.
    fn next(&self) -> Option<Vec<usize>> {
        let tasks = &self.dir.plan.tasks;
        let open = |with_members: bool| -> Vec<usize> {
            let is_next = |&index: &usize| {
                self.standings[index].is_open() && tasks[index].members.is_empty() != with_members
            };
            (0..tasks.len()).filter(is_next).collect()
        };
        [open(false), open(true)]
            .into_iter()
            .find(|open| !open.is_empty())
    }

    fn submission<'b>(&'b self, program: &'b Path) -> Submission<'b> {
        Submission {
            dir: self.dir,
            program,
            array: self.array,
            logs: &self.logs,
            memory_mib: self.memory_mib,
        }
    }

    /// Returns the times of the last checkpoints of tasks.
    fn checkpoints(&self, open: &[usize]) -> Vec<Option<SystemTime>> {
        let of = |index: &usize| {
            let folder = self.dir.task_dir(&self.dir.plan.tasks[*index]);
            let file = std::fs::metadata(folder.join("checkpoint.safetensors"));
            file.and_then(|file| file.modified()).ok()
        };
        open.iter().map(of).collect()
    }

    /// Reports the tasks of `open` that have finished since the last call.
    fn report_done(&mut self, open: &[usize], tell: &mut impl FnMut(Event<'_>)) {
        for &index in open {
            let task = &self.dir.plan.tasks[index];
            if !self.standings[index].is_done && self.dir.state(task) == TaskState::Done {
                self.standings[index].is_done = true;
                let seconds = self.dir.train_seconds(task);
                tell(Event::Done { task, seconds });
            }
        }
    }

    /// Reports the tasks of a job that has ended without their results, and decides which of them are resubmitted.
    ///
    /// # Errors
    /// A full disk.
    fn judge(
        &mut self,
        ended: Ended<'_>,
        tell: &mut impl FnMut(Event<'_>),
    ) -> Result<(), ExperimentError> {
        let Ended {
            job,
            tasks,
            open,
            checkpoints,
        } = ended;
        if open.iter().all(|index| self.standings[*index].is_done) {
            return Ok(());
        }
        let accounted = accounted(job, self.array.poll);
        let now = self.checkpoints(open);
        for (at, &index) in open.iter().enumerate() {
            if self.standings[index].is_done || !tasks.contains(&index) {
                continue;
            }
            let task = &self.dir.plan.tasks[index];
            let log = self.logs.join(format!("{job}_{index}.log"));
            let record = accounted.get(&index);
            let end = End::of(record, &std::fs::read_to_string(&log).unwrap_or_default());
            let reason = self.reason(task, record, end, &log);
            if end == End::DiskFull || is_about_disk(&reason) {
                return Err(ExperimentError::DiskFull {
                    path: self.dir.path().into(),
                    first: task.id.clone(),
                    reason,
                });
            }
            let has_new_checkpoint = now[at] != checkpoints[at];
            match end {
                End::Interrupted => self.interrupted(index, reason, tell),
                End::TimeLimit if has_new_checkpoint => self.interrupted(index, reason, tell),
                End::OutOfMemory => self.out_of_memory(index, record, reason, tell),
                End::TimeLimit | End::Failed | End::DiskFull => self.failed(index, reason, tell),
            }
        }
        Ok(())
    }

    fn interrupted(&mut self, index: usize, reason: String, tell: &mut impl FnMut(Event<'_>)) {
        let standing = &mut self.standings[index];
        standing.interruptions += 1;
        standing.reason = reason.clone();
        let task = &self.dir.plan.tasks[index];
        tell(Event::Interrupted { task, reason });
    }

    fn failed(&mut self, index: usize, reason: String, tell: &mut impl FnMut(Event<'_>)) {
        let standing = &mut self.standings[index];
        standing.attempts += 1;
        standing.reason = reason.clone();
        let (task, attempt) = (&self.dir.plan.tasks[index], standing.attempts);
        tell(Event::Failed {
            task,
            attempt,
            reason,
        });
    }

    /// Asks for twice the memory in the next submission, or gives the task up if its memory is not known in MiB for a whole task.
    fn out_of_memory(
        &mut self,
        index: usize,
        record: Option<&Accounted>,
        reason: String,
        tell: &mut impl FnMut(Event<'_>),
    ) {
        let asked = record.and_then(|record| record.memory_mib);
        let per_core = self
            .array
            .arguments
            .iter()
            .any(|of| of.starts_with("--mem-per"));
        let reason = match asked.filter(|_| !per_core) {
            Some(asked) => {
                let next = 2 * asked;
                self.memory_mib = Some(self.memory_mib.map_or(next, |most| most.max(next)));
                format!("{reason}; it had {asked} MiB, and the next attempt asks for {next} MiB")
            }
            None => {
                self.standings[index].is_given_up = true;
                format!("{reason}; it is not sent again, since it needs more memory")
            }
        };
        self.failed(index, reason, tell);
    }

    /// Returns the reason for a missing result: the end as accounting or the log names it, and the last line of the log.
    fn reason(&self, task: &Task, record: Option<&Accounted>, end: End, log: &Path) -> String {
        let state = match (record, end.name()) {
            (Some(record), _) if end == End::Failed => format!("{}: ", record.state),
            (_, Some(name)) => format!("{name}: "),
            _ => String::new(),
        };
        let text = std::fs::read_to_string(log).unwrap_or_default();
        let last = text.lines().rev().find(|line| !line.trim().is_empty());
        let words = last.map_or_else(
            || self.dir.last_log_line(task),
            |line| tactnet_process::without_prefix(line).into(),
        );
        format!("{state}{words} (log: {})", log.display())
    }

    /// Returns an error if any task is unfinished.
    fn outcome(&self) -> Result<(), ExperimentError> {
        failures(self.dir).map_err(|error| match error {
            ExperimentError::Tasks {
                count,
                all,
                first,
                reason,
            } => {
                let tasks = &self.dir.plan.tasks;
                let at = tasks.iter().position(|task| task.id == first);
                let known = at.map(|at| self.standings[at].reason.clone());
                let known = known.filter(|known| !known.is_empty());
                ExperimentError::Tasks {
                    count,
                    all,
                    first,
                    reason: known.unwrap_or(reason),
                }
            }
            other => other,
        })
    }
}

/// Waits until the job has left the queue; returns true if `stop` returns true before.
///
/// - `look`: called after every query of the queue
///
/// # Errors
/// A queue that does not answer for a long time.
fn is_stopped(
    job: &str,
    poll: Duration,
    stop: impl Fn() -> bool,
    mut look: impl FnMut(),
) -> Result<bool, ExperimentError> {
    let mut refused = 0;
    loop {
        thread::sleep(poll);
        let waiting = in_queue(job);
        look();
        if stop() {
            return Ok(true);
        }
        match waiting {
            Ok(false) => return Ok(false),
            Ok(true) => refused = 0,
            // A busy controller may fail to respond for a while.
            Err(error) => {
                refused += 1;
                if refused > MAX_REFUSALS {
                    return Err(error);
                }
            }
        }
    }
}

/// Cancels a job: pending tasks immediately, and running tasks after a clean stop.
fn cancel(job: &str, poll: Duration) -> Result<(), ExperimentError> {
    call("scancel", &["--state=PENDING", job])?;
    call("scancel", &["--batch", "--signal=TERM", job]).ok();
    let begun = Instant::now();
    while begun.elapsed() < GRACE && in_queue(job).unwrap_or(true) {
        thread::sleep(poll);
    }
    call("scancel", &[job])?;
    Ok(())
}
