//! States of an experiment's tasks.

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
    pub last_progress: String,
}

impl Status {
    /// Returns the current states of the tasks of `dir`.
    pub fn of(dir: &ExperimentDir) -> Self {
        let tasks = dir.plan.tasks.iter().map(|task| {
            let state = dir.state(task);
            let last_progress = match state {
                TaskState::Done | TaskState::Open => String::new(),
                TaskState::Running | TaskState::Interrupted => dir.last_progress(task),
            };
            TaskStatus {
                id: task.id.clone(),
                state,
                last_progress,
            }
        });
        Self {
            schema_version: 1,
            name: dir.plan.recipe.name.clone(),
            tasks: tasks.collect(),
        }
    }
}
