//! States of an experiment's tasks.

use std::fmt;

use serde::Serialize;

use crate::{ExperimentDir, TaskState};

/// The tasks of an experiment with their states.
#[derive(Debug, Clone, Serialize)]
pub struct Status {
    /// Version of this layout: 1.
    pub schema_version: u32,
    /// Name of the experiment.
    pub name: String,
    /// Tasks in the order in which they run.
    pub tasks: Vec<TaskStatus>,
}

/// State of one task.
#[derive(Debug, Clone, Serialize)]
pub struct TaskStatus {
    /// Name of its folder.
    pub id: String,
    /// Current state.
    pub state: TaskState,
    /// Last progress message of a running or interrupted task; empty if there is none.
    #[serde(skip)]
    pub last_words: String,
}

impl Status {
    /// Returns the current states of the tasks of `dir`.
    pub fn of(dir: &ExperimentDir) -> Self {
        let tasks = dir.plan.tasks.iter().map(|task| {
            let state = dir.state(task);
            let last_words = match state {
                TaskState::Done | TaskState::Open => String::new(),
                TaskState::Running | TaskState::Interrupted => dir.last_progress(task),
            };
            TaskStatus {
                id: task.id.clone(),
                state,
                last_words,
            }
        });
        Self {
            schema_version: 1,
            name: dir.plan.recipe.name.clone(),
            tasks: tasks.collect(),
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let count = |state| self.tasks.iter().filter(|task| task.state == state).count();
        write!(
            f,
            "{}: {} task{}, {} done, {} running, {} interrupted, {} open",
            self.name,
            self.tasks.len(),
            if self.tasks.len() == 1 { "" } else { "s" },
            count(TaskState::Done),
            count(TaskState::Running),
            count(TaskState::Interrupted),
            count(TaskState::Open)
        )?;
        for task in &self.tasks {
            let state = match task.state {
                TaskState::Done | TaskState::Open => continue,
                TaskState::Running => "running",
                TaskState::Interrupted => "interrupted",
            };
            write!(f, "\n  {}: {state}", task.id)?;
            if !task.last_words.is_empty() {
                write!(f, ": {}", task.last_words)?;
            }
        }
        if count(TaskState::Running) == 0 && count(TaskState::Done) < self.tasks.len() {
            f.write_str("\n`tactnet experiment run` with this folder goes on with what is left")?;
        }
        Ok(())
    }
}
