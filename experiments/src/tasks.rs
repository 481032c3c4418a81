//! The folder of an experiment: its tasks, their states and their results.
//!
//! | file | content |
//! |---|---|
//! | `experiment.json` | recipe and tasks, written first |
//! | `recipes/NAME.toml` | recipes of models that are not built in |
//! | `tasks/ID/` | run directory of a task, which is finished once `result.json` exists |
//! | `tasks/ID.log` | stderr of the task |
//! | `summary.json`, `report.html` | results |

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tactnet_pipeline::RunDir;
use tactnet_process::without_prefix;

use crate::plan::{Plan, Task};
use crate::{ExperimentError, Job, QuestionResult, RecipeWithData};

/// Lock file, held while the plan is written.
const LOCK: &str = ".lock";
/// Files that a folder may contain before its plan is written.
const OWN: [&str; 4] = [LOCK, "recipes", "tasks", "experiment.json"];

/// Message of a process that was asked to stop and is about to.
pub const STOPPING: &str = "stopping as soon as the run can be resumed; once more to stop at once";

/// State of a task.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TaskState {
    /// Not started.
    Open,
    /// A process runs it.
    Running,
    /// Started, but no process runs it.
    Interrupted,
    /// Finished with a result.
    Done,
}

/// The part of a plan that all versions share.
#[derive(Deserialize)]
struct Version {
    schema_version: u32,
}

/// The way to start a task.
#[derive(Debug, Clone, PartialEq)]
pub enum Start {
    /// Resume the training from the checkpoint in the task's folder.
    Resume,
    /// Start the job from the beginning.
    Begin(Box<Job>),
}

/// The folder of an experiment.
#[derive(Debug, Clone)]
pub struct ExperimentDir {
    path: PathBuf,
    /// Recipe and tasks.
    pub plan: Plan,
}

impl ExperimentDir {
    /// Returns the folder `parent/NAME`, or the first of `parent/NAME-2`, `parent/NAME-3`, … that is free or contains
    /// the same experiment.
    ///
    /// # Errors
    /// An invalid recipe of a model.
    pub fn place_in(
        parent: &Path,
        recipe: &RecipeWithData<'_>,
    ) -> Result<PathBuf, ExperimentError> {
        let plan = Plan::new(recipe, "")?;
        let is_other = |path: &Path| {
            let holds = path.join("experiment.json").exists();
            holds && !Self::open(path).is_ok_and(|known| known.plan.difference(&plan).is_none())
        };
        let name = &plan.recipe.name;
        let numbered = (2..).map(|number| parent.join(format!("{name}-{number}")));
        let mut places = std::iter::once(parent.join(name)).chain(numbered);
        let free = places.find(|path| !is_other(path));
        Ok(free.unwrap_or_else(|| parent.join(name)))
    }

    /// Plans `recipe` in a folder, or opens the folder if it contains the same plan.
    ///
    /// - `command`: command that repeats the experiment
    ///
    /// # Errors
    /// A folder with another experiment or other files; an invalid recipe of a model.
    pub fn create(
        path: &Path,
        recipe: &RecipeWithData<'_>,
        command: &str,
    ) -> Result<Self, ExperimentError> {
        let plan = Plan::new(recipe, command)?;
        let file = path.join("experiment.json");
        let failed = |error| ExperimentError::io(path, "make the experiment's folder", error);
        // A runner that is planning here has created its lock first.
        if !file.exists() && !path.join(LOCK).exists() {
            refuse_foreign(path)?;
        }
        fs::create_dir_all(path).map_err(failed)?;
        // If two runners start together, one writes the plan and the other opens it.
        let planning = fs::File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(path.join(LOCK))
            .map_err(failed)?;
        planning.lock().map_err(failed)?;
        if file.exists() {
            let known = Self::open(path)?;
            return match known.plan.difference(&plan) {
                None => Ok(known),
                Some(reason) => Err(ExperimentError::Occupied {
                    path: path.into(),
                    reason: format!("holds another experiment: {reason}"),
                }),
            };
        }
        refuse_foreign(path)?;
        for folder in ["recipes", "tasks"] {
            fs::create_dir_all(path.join(folder)).map_err(failed)?;
        }
        for (name, text) in &plan.recipes {
            let file = path.join("recipes").join(format!("{name}.toml"));
            tactnet_pipeline::write_whole(&file, text.as_bytes())?;
        }
        write_json(&file, &plan)?;
        let path = path.canonicalize().map_err(failed)?;
        Ok(Self { path, plan })
    }

    /// Opens a planned experiment.
    ///
    /// # Errors
    /// A folder without an experiment, or with one of another version.
    pub fn open(path: &Path) -> Result<Self, ExperimentError> {
        let file = path.join("experiment.json");
        if !file.exists() {
            return Err(ExperimentError::NotPlanned { path: path.into() });
        }
        let text = tactnet_data::read_text(&file)
            .map_err(|error| ExperimentError::io(&file, "read", error))?;
        let refused = |reason: String| ExperimentError::Folder {
            path: file.clone(),
            reason,
        };
        let version: Version =
            serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
        if version.schema_version != Plan::SCHEMA_VERSION {
            return Err(ExperimentError::Occupied {
                path: file,
                reason: format!(
                    "planned by another version of tactnet (schema version {}, this one has {})",
                    version.schema_version,
                    Plan::SCHEMA_VERSION
                ),
            });
        }
        let plan: Plan = serde_json::from_str(&text).map_err(|error| refused(error.to_string()))?;
        let path = path
            .canonicalize()
            .map_err(|error| ExperimentError::io(path, "find", error))?;
        Ok(Self { path, plan })
    }

    /// Returns the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns a task's run directory.
    pub fn task_dir(&self, task: &Task) -> PathBuf {
        self.path.join("tasks").join(&task.id)
    }

    /// Returns the file that receives a task's stderr.
    pub fn log_file(&self, task: &Task) -> PathBuf {
        self.path.join("tasks").join(format!("{}.log", task.id))
    }

    /// Appends a line to a task's log.
    ///
    /// # Errors
    /// A log that cannot be written.
    pub fn note(&self, task: &Task, line: &str) -> Result<(), ExperimentError> {
        let path = self.log_file(task);
        let log = fs::File::options().create(true).append(true).open(&path);
        log.and_then(|mut log| writeln!(log, "{line}"))
            .map_err(|error| ExperimentError::io(&path, "write", error))
    }

    /// Returns the state of a task.
    pub fn state(&self, task: &Task) -> TaskState {
        let folder = self.task_dir(task);
        if folder.join("result.json").exists() {
            TaskState::Done
        } else if RunDir::is_busy(&folder) {
            TaskState::Running
        } else if folder.exists() {
            TaskState::Interrupted
        } else {
            TaskState::Open
        }
    }

    /// Returns the task with this name.
    ///
    /// # Errors
    /// An unknown name.
    pub fn task(&self, id: &str) -> Result<&Task, ExperimentError> {
        let found = self.plan.tasks.iter().find(|task| task.id == id);
        found.ok_or_else(|| ExperimentError::Folder {
            path: self.path.clone(),
            reason: format!(
                "none of its {} tasks is called `{id}`",
                self.plan.tasks.len()
            ),
        })
    }

    /// Returns how to start a task from its current state. Removes a training that was interrupted before it wrote its
    /// configuration; trained networks of a question are kept.
    ///
    /// # Errors
    /// Files that cannot be removed.
    pub fn begin(&self, task: &Task) -> Result<Start, ExperimentError> {
        let folder = self.task_dir(task);
        if folder.join("config.json").exists() {
            return Ok(Start::Resume);
        }
        let mut job = task.job.clone();
        if matches!(job, Job::Train(_)) && folder.exists() {
            fs::remove_dir_all(&folder)
                .map_err(|error| ExperimentError::io(&folder, "remove the remains of", error))?;
        }
        let spec = job.spec_mut();
        if let Some(file) = spec.recipe.strip_prefix(Plan::OWN_RECIPE) {
            spec.recipe = self.path.join("recipes").join(file).display().to_string();
        }
        Ok(Start::Begin(Box::new(job)))
    }

    /// Returns the runs of a committee's members, from whose predictions it can be averaged; empty unless all have ended.
    ///
    /// # Errors
    /// A member that is no task of the plan; a folder without a run.
    pub fn members(&self, task: &Task) -> Result<Vec<RunDir>, ExperimentError> {
        let mut runs = Vec::new();
        for id in &task.members {
            let member = self.task(id)?;
            if self.state(member) != TaskState::Done {
                return Ok(Vec::new());
            }
            runs.push(RunDir::open(&self.task_dir(member))?);
        }
        Ok(runs)
    }

    /// Returns the training time of a finished task, in seconds.
    pub(crate) fn train_seconds(&self, task: &Task) -> f64 {
        if let Job::Question(_) = task.job {
            return self
                .question_result(task)
                .map_or(0.0, |result| result.seconds);
        }
        let result = RunDir::open(&self.task_dir(task)).and_then(|run| run.result());
        result
            .ok()
            .flatten()
            .map_or(0.0, |result| result.train_seconds)
    }

    /// Reads the result of a question's finished task.
    ///
    /// # Errors
    /// A missing or damaged result, or one of another version.
    pub(crate) fn question_result(&self, task: &Task) -> Result<QuestionResult, ExperimentError> {
        let path = self.task_dir(task).join("result.json");
        let text = tactnet_data::read_text(&path)
            .map_err(|error| ExperimentError::io(&path, "read", error))?;
        let damaged = |reason: String| ExperimentError::Folder {
            path: path.clone(),
            reason,
        };
        let result: QuestionResult =
            serde_json::from_str(&text).map_err(|error| damaged(error.to_string()))?;
        if result.schema_version != QuestionResult::SCHEMA_VERSION {
            return Err(damaged(format!(
                "expected schema version {}, found {}",
                QuestionResult::SCHEMA_VERSION,
                result.schema_version
            )));
        }
        Ok(result)
    }

    /// Returns the last line of a task's log.
    pub fn last_log_line(&self, task: &Task) -> String {
        let log = fs::read_to_string(self.log_file(task)).unwrap_or_default();
        let line = log.lines().rev().find(|line| !line.trim().is_empty());
        without_prefix(line.unwrap_or("its log is empty")).into()
    }

    /// Returns the error with which a task ended; `None` if it runs, was interrupted, or did not fail.
    pub(crate) fn failure(&self, task: &Task) -> Option<String> {
        if self.state(task) != TaskState::Interrupted {
            return None;
        }
        let log = fs::read_to_string(self.log_file(task)).unwrap_or_default();
        let line = log.lines().rev().find(|line| !line.trim().is_empty())?;
        let message = line.strip_prefix("error: ")?;
        Some(message.into())
    }

    /// Returns the last line of a task's log that is not about stopping; empty if there is none.
    pub(crate) fn last_progress(&self, task: &Task) -> String {
        let log = fs::read_to_string(self.log_file(task)).unwrap_or_default();
        without_prefix(last_progress_in(&log)).into()
    }

    /// Writes `value` into the folder as JSON, atomically.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), ExperimentError> {
        write_json(&self.path.join(name), value)
    }

    /// Writes a file into the folder, atomically.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ExperimentError> {
        tactnet_pipeline::write_whole(&self.path.join(name), bytes).map_err(ExperimentError::from)
    }
}

/// Returns true for a line about a disk that is full, a quota that is used up, or a file that is larger than allowed.
pub(crate) fn is_about_disk(line: &str) -> bool {
    let line = line.to_lowercase();
    let words = [
        "no space left on device",
        "disk quota exceeded",
        "quota exceeded",
        "file too large",
    ];
    words.iter().any(|words| line.contains(words))
}

/// Returns the last line of a log that is not about stopping.
fn last_progress_in(log: &str) -> &str {
    let is_about_stopping =
        |line: &str| line.starts_with(STOPPING) || line.starts_with("stopped; ");
    let mut lines = log.lines().rev().map(str::trim);
    let line = lines.find(|line| !line.is_empty() && !is_about_stopping(line));
    line.unwrap_or_default()
}

/// Returns an error if a folder contains files that no experiment wrote; a missing folder is fine.
fn refuse_foreign(path: &Path) -> Result<(), ExperimentError> {
    let failed = |error| ExperimentError::io(path, "look into the experiment's folder", error);
    if !path.exists() {
        return Ok(());
    }
    for entry in fs::read_dir(path).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        let unfinished = name
            .to_str()
            .is_some_and(|name| name.starts_with(tactnet_pipeline::UNFINISHED));
        if !unfinished && !OWN.iter().any(|own| name == *own) {
            return Err(ExperimentError::Occupied {
                path: path.into(),
                reason: "an experiment needs a new or empty folder".into(),
            });
        }
    }
    Ok(())
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), ExperimentError> {
    let mut text = serde_json::to_string_pretty(value)
        .unwrap_or_else(|error| panic!("what an experiment writes is always valid JSON: {error}"));
    text.push('\n');
    tactnet_pipeline::write_whole(path, text.as_bytes()).map_err(ExperimentError::from)
}

#[cfg(test)]
mod tests;
