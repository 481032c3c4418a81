//! The states of an experiment's tasks on a terminal.

use std::fmt;

use tactnet_experiments::{Status, TaskState};

/// Text of a [`Status`]: the numbers of tasks, the unfinished ones that have started, and the next command.
pub struct StatusText<'a>(pub &'a Status);

impl fmt::Display for StatusText<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(status) = self;
        let count = |state| {
            status
                .tasks
                .iter()
                .filter(|task| task.state == state)
                .count()
        };
        write!(
            f,
            "{}: {} task{}, {} done, {} running, {} interrupted, {} open",
            status.name,
            status.tasks.len(),
            if status.tasks.len() == 1 { "" } else { "s" },
            count(TaskState::Done),
            count(TaskState::Running),
            count(TaskState::Interrupted),
            count(TaskState::Open)
        )?;
        for task in &status.tasks {
            let state = match task.state {
                TaskState::Done | TaskState::Open => continue,
                TaskState::Running => "running",
                TaskState::Interrupted => "interrupted",
            };
            write!(f, "\n  {}: {state}", task.id)?;
            if !task.last_progress.is_empty() {
                write!(f, ": {}", task.last_progress)?;
            }
        }
        if count(TaskState::Running) == 0 && count(TaskState::Done) < status.tasks.len() {
            f.write_str("\n`tactnet experiment run` with this folder resumes the experiment")?;
        }
        Ok(())
    }
}
