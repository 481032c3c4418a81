//! Runs tasks on a cluster: submits a Slurm array job, polls it until it leaves the queue, and resubmits failed tasks.

use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

use tactnet_pipeline::write_whole;
use tactnet_process::without_prefix;

use crate::local::failures;
use crate::tasks::{ExperimentDir, TaskState};
use crate::{Event, ExperimentError, Task, TimeLeft};

/// Maximum number of submissions for each task.
const ATTEMPTS: usize = 3;

/// Number of consecutive failed queries of the queue after which a run fails.
const MAX_REFUSALS: usize = 30;

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

/// Submits all unfinished tasks, waits for them, and resubmits failed ones.
///
/// Every node must see the experiment's folder and the program under the same path.
///
/// - `stop`: polled often; once it returns true, the array job is cancelled, and its tasks stop where they can be
///   resumed
///
/// # Errors
/// Missing or failing Slurm programs; tasks that failed three times.
pub fn run_on_slurm(
    dir: &ExperimentDir,
    program: &Path,
    array: &SlurmArray,
    stop: impl Fn() -> bool,
    mut tell: impl FnMut(Event<'_>),
) -> Result<(), ExperimentError> {
    let tasks = &dir.plan.tasks;
    let logs = dir.path().join("slurm");
    std::fs::create_dir_all(&logs).map_err(|error| ExperimentError::io(&logs, "make", error))?;
    let mut known: Vec<bool> = tasks
        .iter()
        .map(|t| dir.state(t) == TaskState::Done)
        .collect();
    tell(Event::Begun {
        done: known.iter().filter(|known| **known).count(),
        all: tasks.len(),
        left: TimeLeft::of(dir, array.jobs),
    });
    // Committees are submitted once the tasks of their members have left the queue.
    for (attempt, with_members) in (1..=ATTEMPTS).flat_map(|n| [(n, false), (n, true)]) {
        let is_next = |&i: &usize| !known[i] && tasks[i].members.is_empty() != with_members;
        let open: Vec<usize> = (0..tasks.len()).filter(is_next).collect();
        if open.is_empty() {
            continue;
        }
        // Wait for a job that survived its runner instead of submitting it again.
        let job = match left_behind(&logs) {
            Some(job) => job,
            None => submit(dir, program, array, &logs, &open)?,
        };
        let look = || report_done(dir, &open, &mut known, &mut tell);
        if is_stopped(&job, array.poll, &stop, look)? {
            return cancel(&job, array.poll);
        }
        report_done(dir, &open, &mut known, &mut tell);
        for &index in open.iter().filter(|&&index| !known[index]) {
            let task = &tasks[index];
            let reason = failure_reason(dir, task, &logs, &job, index);
            tell(Event::Failed {
                task,
                attempt,
                reason,
            });
        }
    }
    failures(dir)
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

/// Reports the tasks of `open` that have finished since the last call, and marks them as known.
fn report_done(
    dir: &ExperimentDir,
    open: &[usize],
    known: &mut [bool],
    tell: &mut impl FnMut(Event<'_>),
) {
    for &index in open {
        let task = &dir.plan.tasks[index];
        if !known[index] && dir.state(task) == TaskState::Done {
            known[index] = true;
            let seconds = dir.train_seconds(task);
            tell(Event::Done { task, seconds });
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

/// Returns the job of an earlier runner that is still in the queue.
fn left_behind(logs: &Path) -> Option<String> {
    let job = std::fs::read_to_string(logs.join("job")).ok()?;
    let job = job.trim().to_string();
    (!job.is_empty() && in_queue(&job).unwrap_or(false)).then_some(job)
}

/// Submits one array job, whose array indices are task numbers, and returns its id.
fn submit(
    dir: &ExperimentDir,
    program: &Path,
    array: &SlurmArray,
    logs: &Path,
    open: &[usize],
) -> Result<String, ExperimentError> {
    let script = format!(
        "#!/bin/sh\nexec {} experiment task {} \"$SLURM_ARRAY_TASK_ID\" --threads {}\n",
        quoted(program),
        quoted(dir.path()),
        array.cores
    );
    let path = logs.join("task.sh");
    write_whole(&path, script.as_bytes())?;
    let mut arguments = vec![
        "--parsable".to_string(),
        format!("--array={}%{}", ranges(open), array.jobs.max(1)),
        format!("--job-name=tactnet-{}", dir.plan.recipe.name),
        format!("--output={}/%A_%a.log", logs.display()),
        format!("--cpus-per-task={}", array.cores),
        format!("--chdir={}", dir.path().display()),
    ];
    arguments.extend(array.arguments.iter().cloned());
    arguments.push(path.display().to_string());
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let answer = call("sbatch", &arguments)?;
    // Format: "ID" or "ID;CLUSTER".
    let id = answer
        .trim()
        .split(';')
        .next()
        .unwrap_or_default()
        .to_string();
    if id.is_empty() || !id.chars().all(|c| c.is_ascii_digit()) {
        return Err(ExperimentError::Slurm {
            program: "sbatch",
            reason: format!("expected a job id, found `{}`", answer.trim()),
        });
    }
    let path = logs.join("job");
    write_whole(&path, id.as_bytes())?;
    Ok(id)
}

/// Returns true while any task of the job waits or runs.
fn in_queue(job: &str) -> Result<bool, ExperimentError> {
    match call("squeue", &["--noheader", "--jobs", job, "--format=%i"]) {
        Ok(answer) => Ok(!answer.trim().is_empty()),
        // The controller forgets a job some minutes after its end.
        Err(ExperimentError::Slurm { reason, .. }) if reason.contains("Invalid job id") => {
            Ok(false)
        }
        Err(error) => Err(error),
    }
}

/// Returns the reason for a missing result: the state known to accounting, and the last line of the log.
fn failure_reason(
    dir: &ExperimentDir,
    task: &Task,
    logs: &Path,
    job: &str,
    index: usize,
) -> String {
    let id = format!("{job}_{index}");
    let state = call(
        "sacct",
        &["--noheader", "--parsable2", "--format=State", "--jobs", &id],
    )
    .ok()
    .and_then(|answer| answer.lines().next().map(|state| format!("{state}: ")))
    .unwrap_or_default();
    let log = logs.join(format!("{id}.log"));
    let of_job = std::fs::read_to_string(&log).unwrap_or_default();
    let last = of_job.lines().rev().find(|line| !line.trim().is_empty());
    let words = last.map_or_else(
        || dir.last_log_line(task),
        |line| without_prefix(line).into(),
    );
    format!("{state}{words} (log: {})", log.display())
}

fn call(program: &'static str, arguments: &[&str]) -> Result<String, ExperimentError> {
    let refused = |reason: String| ExperimentError::Slurm { program, reason };
    let output = Command::new(program)
        .args(arguments)
        .output()
        .map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => {
                refused("not found; Slurm's client programs must be installed".into())
            }
            _ => refused(error.to_string()),
        })?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    Err(refused(said.trim().replace('\n', " / ")))
}

/// Formats numbers as ranges, such as `0-3,7`.
fn ranges(numbers: &[usize]) -> String {
    let mut parts: Vec<(usize, usize)> = Vec::new();
    for &number in numbers {
        match parts.last_mut() {
            Some((_, last)) if *last + 1 == number => *last = number,
            _ => parts.push((number, number)),
        }
    }
    let shown = parts.iter().map(|(first, last)| {
        if first == last {
            first.to_string()
        } else {
            format!("{first}-{last}")
        }
    });
    shown.collect::<Vec<_>>().join(",")
}

/// Quotes a path for a POSIX shell.
fn quoted(path: &Path) -> String {
    format!("'{}'", path.display().to_string().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn array_indices_are_short_and_paths_survive_the_shell() {
        assert_eq!(ranges(&[0, 1, 2, 3, 7, 9, 10]), "0-3,7,9-10");
        assert_eq!(quoted(Path::new("/a b/it's")), r"'/a b/it'\''s'");
    }
}
