//! Ends of tasks without a result, as accounting or the log names them.

use std::collections::BTreeMap;
use std::time::Duration;

use super::queue::call;
use crate::tasks::is_about_disk;

/// What accounting knows of a task.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Accounted {
    /// State in Slurm's words, such as `OUT_OF_MEMORY`.
    pub(super) state: String,
    /// Requested memory of the task in MiB; `None` if it is unknown or requested for each core.
    pub(super) memory_mib: Option<u64>,
}

/// End of a task without a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// Preempted, or its node failed.
    Interrupted,
    /// Its time was over.
    TimeLimit,
    /// It needed more memory than it had.
    OutOfMemory,
    /// A disk was full, a quota used up, or a file larger than allowed.
    DiskFull,
    /// Anything else.
    Failed,
}

/// Parts of what Slurm writes to the log of a task.
const IN_LOGS: [(&str, End); 6] = [
    ("due to preemption", End::Interrupted),
    ("due to node failure", End::Interrupted),
    ("due to time limit", End::TimeLimit),
    ("oom-kill", End::OutOfMemory),
    ("oom_kill", End::OutOfMemory),
    ("oom killed", End::OutOfMemory),
];

impl End {
    /// Returns the end by the state of accounting, and otherwise by the log.
    pub(super) fn of(record: Option<&Accounted>, log: &str) -> Self {
        match record.map(|record| record.state.as_str()) {
            Some("PREEMPTED" | "NODE_FAIL" | "BOOT_FAIL" | "REQUEUED" | "REVOKED") => {
                return Self::Interrupted;
            }
            Some("TIMEOUT" | "DEADLINE") => return Self::TimeLimit,
            Some("OUT_OF_MEMORY") => return Self::OutOfMemory,
            _ => {}
        }
        // Without accounting, or of a task whose process was killed and whose job counts as failed.
        let lower = log.to_lowercase();
        let named = IN_LOGS.iter().find(|(part, _)| lower.contains(part));
        match named {
            Some((_, end)) => *end,
            None if log.lines().next_back().is_some_and(is_about_disk) => Self::DiskFull,
            None => Self::Failed,
        }
    }

    /// Returns the words for messages; `None` for a failure of the task itself.
    pub(super) fn name(self) -> Option<&'static str> {
        match self {
            Self::Interrupted => Some("preempted, or its node failed"),
            Self::TimeLimit => Some("time limit"),
            Self::OutOfMemory => Some("out of memory"),
            Self::DiskFull => Some("disk full"),
            Self::Failed => None,
        }
    }
}

/// Returns what accounting knows of the tasks of a job, by task number; empty without accounting.
pub(super) fn accounted(job: &str, poll: Duration) -> BTreeMap<usize, Accounted> {
    let arguments = [
        "--noheader",
        "--parsable2",
        "--format=JobID,State,ReqMem",
        "--jobs",
        job,
    ];
    let mut found = BTreeMap::new();
    // Accounting may lag behind or fail for a moment.
    for _ in 0..3 {
        if let Ok(answer) = call("sacct", &arguments) {
            found = parsed(job, &answer);
            let runs = |of: &Accounted| RUNNING.contains(&of.state.as_str());
            if !found.is_empty() && !found.values().any(runs) {
                return found;
            }
        }
        std::thread::sleep(poll);
    }
    found
}

/// States of tasks that have not ended.
const RUNNING: [&str; 4] = ["PENDING", "RUNNING", "COMPLETING", "SUSPENDED"];

/// Returns the tasks in an answer of `sacct`. A step that ran out of memory counts for its task.
fn parsed(job: &str, answer: &str) -> BTreeMap<usize, Accounted> {
    let mut found: BTreeMap<usize, Accounted> = BTreeMap::new();
    for line in answer.lines() {
        let mut fields = line.trim().split('|');
        let (Some(id), Some(state)) = (fields.next(), fields.next()) else {
            continue;
        };
        let Some(of_job) = id.strip_prefix(job).and_then(|id| id.strip_prefix('_')) else {
            continue;
        };
        let (number, step) = of_job.split_once('.').unwrap_or((of_job, ""));
        let Ok(number) = number.parse::<usize>() else {
            continue;
        };
        // `CANCELLED by 1000`
        let state = state.split_whitespace().next().unwrap_or_default();
        if step.is_empty() {
            let record = Accounted {
                state: state.into(),
                memory_mib: fields.next().and_then(mib),
            };
            found.insert(number, record);
        } else if state == "OUT_OF_MEMORY"
            && let Some(record) = found.get_mut(&number)
        {
            record.state = state.into();
        }
    }
    found
}

/// Returns requested memory such as `4000M` or `4Gn` in MiB; `None` for memory of each core and for no limit.
fn mib(text: &str) -> Option<u64> {
    let text = text.strip_suffix('n').unwrap_or(text);
    let (number, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    let number: f64 = number.parse().ok()?;
    let factor = match unit {
        "K" => 1.0 / 1024.0,
        "M" => 1.0,
        "G" => 1024.0,
        "T" => 1024.0 * 1024.0,
        _ => return None,
    };
    let mib = (number * factor).round() as u64;
    (mib > 0).then_some(mib)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accounting_names_the_ends_of_tasks() {
        let answer = "7_0|COMPLETED|100M\n7_0.batch|COMPLETED|\n7_1|FAILED|2Gn\n7_1.batch|OUT_OF_MEMORY|\n\
            7_2|CANCELLED by 0|4Gc\n7_[3-9]|PENDING|1G\n70_4|FAILED|1G\n";
        let found = parsed("7", answer);
        let states: Vec<_> = found
            .values()
            .map(|of| (of.state.as_str(), of.memory_mib))
            .collect();
        let expected = [
            ("COMPLETED", Some(100)),
            ("OUT_OF_MEMORY", Some(2048)),
            ("CANCELLED", None),
        ];
        assert_eq!(states, expected);
    }

    #[test]
    fn the_log_names_the_end_where_accounting_does_not() {
        let failed = Accounted {
            state: "FAILED".into(),
            memory_mib: None,
        };
        for (log, end) in [
            (
                "slurmstepd: error: *** JOB 5 ON n1 CANCELLED AT … DUE TO TIME LIMIT ***",
                End::TimeLimit,
            ),
            (
                "slurmstepd: error: *** JOB 5 ON n1 CANCELLED AT … DUE TO PREEMPTION ***",
                End::Interrupted,
            ),
            (
                "slurmstepd: error: *** JOB 5 ON n1 CANCELLED AT … DUE TO NODE FAILURE ***",
                End::Interrupted,
            ),
            (
                "slurmstepd: error: Detected 1 oom_kill event in StepId=5.batch.",
                End::OutOfMemory,
            ),
            (
                "error: result.json: cannot write: No space left on device",
                End::DiskFull,
            ),
            (
                "error: result.json: cannot write: File too large",
                End::DiskFull,
            ),
            (
                "error: a window of 0.1 s is longer than a sweep",
                End::Failed,
            ),
        ] {
            assert_eq!(End::of(None, log), end, "{log}");
            assert_eq!(End::of(Some(&failed), log), end, "{log}");
        }
        let preempted = Accounted {
            state: "PREEMPTED".into(),
            memory_mib: None,
        };
        assert_eq!(End::of(Some(&preempted), ""), End::Interrupted);
    }
}
