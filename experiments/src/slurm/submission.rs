//! Submission of an array job, and the search for one that was submitted before.
//!
//! A job is found by its name and its comment, which contains the experiment's folder, so that neither a lost answer of `sbatch` nor a killed runner
//! leaves a job that nobody waits for.

use std::path::Path;
use std::thread;

use serde::{Deserialize, Serialize};
use tactnet_pipeline::write_whole;

use super::SlurmArray;
use super::queue::{MAX_REFUSALS, ask, call, in_queue, is_transient};
use crate::ExperimentError;
use crate::tasks::ExperimentDir;

/// File with the last submission.
const RECORD: &str = "job.json";

/// Number of polls after which a job that `sbatch` may have submitted is in the queue.
const SETTLED: usize = 3;

/// An array job to submit.
pub(super) struct Submission<'a> {
    pub(super) dir: &'a ExperimentDir,
    pub(super) program: &'a Path,
    pub(super) array: &'a SlurmArray,
    /// Folder of the logs.
    pub(super) logs: &'a Path,
    /// Memory of each task, in MiB; `None`: that of the arguments or of the cluster.
    pub(super) memory_mib: Option<u64>,
}

/// A submission, as it is recorded before `sbatch` is called and after its answer.
#[derive(Debug, Serialize, Deserialize)]
struct Record {
    name: String,
    comment: String,
    /// Id of the job; absent before the answer.
    job: Option<String>,
    /// Numbers of its tasks.
    tasks: Vec<usize>,
}

impl Submission<'_> {
    /// Returns the name of its jobs; commas separate names in Slurm.
    fn name(&self) -> String {
        format!("tactnet-{}", self.dir.plan.recipe.name).replace(',', "_")
    }

    /// Returns the comment of its jobs.
    fn comment(&self) -> String {
        format!("tactnet {}", self.dir.path().display())
    }

    fn record(&self) -> Option<Record> {
        let text = std::fs::read_to_string(self.logs.join(RECORD)).ok()?;
        serde_json::from_str(&text).ok()
    }

    fn write_record(&self, job: Option<&str>, tasks: &[usize]) -> Result<(), ExperimentError> {
        let record = Record {
            name: self.name(),
            comment: self.comment(),
            job: job.map(String::from),
            tasks: tasks.to_vec(),
        };
        let text = serde_json::to_string_pretty(&record)
            .unwrap_or_else(|error| panic!("a record is always valid JSON: {error}"));
        write_whole(&self.logs.join(RECORD), text.as_bytes()).map_err(ExperimentError::from)
    }

    /// Returns the newest job of this experiment in the queue.
    fn in_queue(&self) -> Result<Option<String>, ExperimentError> {
        let name = format!("--name={}", self.name());
        let arguments = ["--noheader", &name, "--format=%F|%k"];
        let answer = ask("squeue", &arguments, self.array.poll)?;
        let comment = self.comment();
        let jobs = answer.lines().filter_map(|line| {
            let (job, found) = line.trim().split_once('|')?;
            (found.trim() == comment).then(|| job.parse::<u64>().ok())?
        });
        Ok(jobs.max().map(|job| job.to_string()))
    }

    /// Writes the script of the tasks and returns the arguments of `sbatch`.
    fn arguments(&self, open: &[usize]) -> Result<Vec<String>, ExperimentError> {
        let Self {
            dir, array, logs, ..
        } = self;
        let script = format!(
            "#!/bin/sh\nexec {} experiment task {} \"$SLURM_ARRAY_TASK_ID\" --threads {}\n",
            quoted(self.program),
            quoted(dir.path()),
            array.cores
        );
        let path = logs.join("task.sh");
        write_whole(&path, script.as_bytes())?;
        let mut arguments = vec![
            "--parsable".to_string(),
            format!("--array={}%{}", ranges(open), array.jobs.max(1)),
            format!("--job-name={}", self.name()),
            format!("--comment={}", self.comment()),
            format!("--output={}/%A_%a.log", logs.display()),
            format!("--cpus-per-task={}", array.cores),
            format!("--chdir={}", dir.path().display()),
        ];
        arguments.extend(array.arguments.iter().cloned());
        arguments.extend(self.memory_mib.map(|mib| format!("--mem={mib}M")));
        arguments.push(path.display().to_string());
        Ok(arguments)
    }
}

/// Returns a job of this experiment that is still in the queue.
///
/// # Errors
/// A queue that does not answer for a long time.
pub(super) fn find(submission: &Submission<'_>) -> Result<Option<String>, ExperimentError> {
    if let Some(job) = submission.in_queue()? {
        return Ok(Some(job));
    }
    // A site may replace comments.
    let recorded = submission.record().and_then(|record| record.job);
    Ok(recorded.filter(|job| in_queue(job).unwrap_or(false)))
}

/// Returns the numbers of a job's tasks, if they were recorded.
pub(super) fn recorded_tasks(submission: &Submission<'_>, job: &str) -> Option<Vec<usize>> {
    let record = submission.record()?;
    // Without an id, the runner ended before the answer to this submission.
    let is_same = record.job.is_none_or(|known| known == job);
    is_same.then_some(record.tasks)
}

/// Submits one array job, whose array indices are task numbers, and returns its id.
///
/// # Errors
/// A program that is missing, refuses the job, or has failed for a long time.
pub(super) fn submit(
    submission: &Submission<'_>,
    open: &[usize],
) -> Result<String, ExperimentError> {
    let arguments = submission.arguments(open)?;
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    submission.write_record(None, open)?;
    let mut refused = 0;
    let job = loop {
        match call("sbatch", &arguments) {
            Ok(answer) => match id_in(&answer) {
                Some(job) => break job,
                None => break settled(submission)?.ok_or_else(|| no_id(&answer))?,
            },
            Err(error) if is_transient(&error) && refused < MAX_REFUSALS => {
                refused += 1;
                // The controller may have accepted the job whose answer was lost.
                if let Some(job) = settled(submission)? {
                    break job;
                }
            }
            Err(error) => return Err(error),
        }
    };
    submission.write_record(Some(&job), open)?;
    Ok(job)
}

/// Waits until a job that `sbatch` may have submitted is in the queue; returns `None` if there is none.
fn settled(submission: &Submission<'_>) -> Result<Option<String>, ExperimentError> {
    for _ in 0..SETTLED {
        thread::sleep(submission.array.poll);
        if let Some(job) = submission.in_queue()? {
            return Ok(Some(job));
        }
    }
    Ok(None)
}

fn no_id(answer: &str) -> ExperimentError {
    ExperimentError::Slurm {
        program: "sbatch",
        reason: format!(
            "expected a job id, found `{}`, and no job of this experiment is in the queue",
            answer.trim().replace('\n', " / ")
        ),
    }
}

/// Returns the job id in an answer of `sbatch --parsable`, `ID` or `ID;CLUSTER` in a line of its own; sites print other lines as well.
fn id_in(answer: &str) -> Option<String> {
    let mut lines = answer.lines().rev().map(str::trim);
    let is_number = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    lines.find_map(|line| {
        let (id, cluster) = line.split_once(';').unwrap_or((line, ""));
        let is_id = is_number(id) && !cluster.contains(char::is_whitespace);
        is_id.then(|| id.to_string())
    })
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

    #[test]
    fn the_job_id_is_found_among_the_lines_of_a_site() {
        for (answer, id) in [
            ("17\n", Some("17")),
            ("17;fast\n", Some("17")),
            ("* 99 jobs wait; be patient *\n17\n", Some("17")),
            ("17;fast\nQuota: 5 of 10 TB\n", Some("17")),
            ("Submitted; see 17\n", None),
            ("", None),
        ] {
            assert_eq!(id_in(answer).as_deref(), id, "{answer}");
        }
    }
}
