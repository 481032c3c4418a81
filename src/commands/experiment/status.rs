//! `tactnet experiment status`: where the tasks stand.

use std::process::ExitCode;

use serde::Serialize;
use tactnet_experiments::{ExperimentDir, Task, TaskState};

use super::arguments::DirArgs;
use crate::output;

/// The document of `status --json`.
#[derive(Serialize)]
struct Status<'a> {
    schema_version: u32,
    name: &'a str,
    tasks: Vec<TaskStatus<'a>>,
}

#[derive(Serialize)]
struct TaskStatus<'a> {
    id: &'a str,
    state: TaskState,
}

/// Prints where the tasks of an experiment stand.
pub fn status(arguments: &DirArgs) -> anyhow::Result<ExitCode> {
    let dir = ExperimentDir::open(&arguments.dir)?;
    let states: Vec<(&Task, TaskState)> = dir
        .plan
        .tasks
        .iter()
        .map(|task| (task, dir.state(task)))
        .collect();
    if arguments.json {
        let tasks = states.iter().map(|(task, state)| TaskStatus {
            id: &task.id,
            state: *state,
        });
        output::print_json(&Status {
            schema_version: 1,
            name: &dir.plan.recipe.name,
            tasks: tasks.collect(),
        })?;
        return Ok(ExitCode::SUCCESS);
    }
    let count = |wanted: TaskState| states.iter().filter(|(_, state)| *state == wanted).count();
    output::print(format_args!(
        "{}: {} tasks, {} done, {} running, {} interrupted, {} open",
        dir.plan.recipe.name,
        states.len(),
        count(TaskState::Done),
        count(TaskState::Running),
        count(TaskState::Interrupted),
        count(TaskState::Open)
    ))?;
    for (task, state) in &states {
        let note = match state {
            TaskState::Done | TaskState::Open => continue,
            TaskState::Running => "running: ",
            TaskState::Interrupted => "interrupted: ",
        };
        output::print(format_args!(
            "  {}: {note}{}",
            task.id,
            dir.last_words(task)
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}
