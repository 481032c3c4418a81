//! What happens while an experiment runs.

use crate::{Task, TimeLeft};

/// An event that a runner reports.
#[derive(Debug, Clone, PartialEq)]
pub enum Event<'a> {
    /// The runner has begun.
    Begun {
        /// Tasks that had ended before.
        done: usize,
        /// Tasks there are.
        all: usize,
        /// What is known of how long they will take.
        left: TimeLeft,
    },
    /// A task runs.
    Started {
        /// Which.
        task: &'a Task,
    },
    /// A task has ended well.
    Done {
        /// Which.
        task: &'a Task,
        /// Time since it was started here, of networks trained at once its share; with Slurm, its training time; 0 where another runner did it.
        seconds: f64,
    },
    /// A task has ended without a result; it is begun again a bounded number of times.
    Failed {
        /// Which.
        task: &'a Task,
        /// How often it has failed now.
        attempt: usize,
        /// Last line of its log.
        reason: String,
    },
}
