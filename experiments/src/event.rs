//! Progress events of a running experiment.

use crate::{Task, TimeLeft};

/// An event that a runner reports.
#[derive(Debug, Clone, PartialEq)]
pub enum Event<'a> {
    /// The runner has started.
    Begun {
        /// Number of tasks that were already finished.
        done: usize,
        /// Number of all tasks.
        all: usize,
        /// Estimate of the remaining time.
        left: TimeLeft,
    },
    /// A task has started.
    Started {
        /// The task.
        task: &'a Task,
    },
    /// A task has finished successfully.
    Done {
        /// The task.
        task: &'a Task,
        /// Elapsed time in seconds. Networks that are trained together share it equally. With Slurm it is the training
        /// time; it is 0 if another runner ran the task.
        seconds: f64,
    },
    /// The cluster ended a task before it was finished; the task goes on later, and no attempt is used up.
    Interrupted {
        /// The task.
        task: &'a Task,
        /// The cluster's reason.
        reason: String,
    },
    /// A task has failed; it is retried a limited number of times.
    Failed {
        /// The task.
        task: &'a Task,
        /// Number of failures so far.
        attempt: usize,
        /// Last line of its log.
        reason: String,
    },
}
