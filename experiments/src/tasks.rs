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
use crate::{ExperimentError, ExperimentRecipe, Job, QuestionResult};

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
    pub fn place_in(parent: &Path, recipe: &ExperimentRecipe) -> Result<PathBuf, ExperimentError> {
        let plan = Plan::new(recipe, "")?;
        let is_other = |path: &Path| {
            let holds = path.join("experiment.json").exists();
            holds && !Self::open(path).is_ok_and(|known| known.plan.difference(&plan).is_none())
        };
        let numbered = (2..).map(|number| parent.join(format!("{}-{number}", recipe.name)));
        let mut places = std::iter::once(parent.join(&recipe.name)).chain(numbered);
        let free = places.find(|path| !is_other(path));
        Ok(free.unwrap_or_else(|| parent.join(&recipe.name)))
    }

    /// Plans `recipe` in a folder, or opens the folder if it contains the same plan.
    ///
    /// - `command`: command that repeats the experiment
    ///
    /// # Errors
    /// A folder with another experiment or other files; an invalid recipe of a model.
    pub fn create(
        path: &Path,
        recipe: &ExperimentRecipe,
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
                Some(reason) => Err(ExperimentError::Folder {
                    path: path.into(),
                    reason: format!(
                        "holds another experiment: {reason}; name another folder with `--out`"
                    ),
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
            return Err(ExperimentError::Folder {
                path: path.into(),
                reason: "no experiment here (no experiment.json); name a folder that `tactnet experiment run` made".into(),
            });
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
            return Err(refused(format!(
                "planned by another version of tactnet (schema version {}, this one has {}); run the experiment in a new folder with `--out`",
                version.schema_version,
                Plan::SCHEMA_VERSION
            )));
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
    pub fn last_words(&self, task: &Task) -> String {
        let log = fs::read_to_string(self.log_file(task)).unwrap_or_default();
        let line = log.lines().rev().find(|line| !line.trim().is_empty());
        without_prefix(line.unwrap_or("it said nothing")).into()
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
            return Err(ExperimentError::Folder {
                path: path.into(),
                reason: "an experiment needs a new or empty folder; name another with `--out`"
                    .into(),
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
mod tests {
    use super::*;

    #[test]
    fn what_is_said_about_stopping_is_no_progress() {
        let epoch = "epoch 2/3: loss 0.5, training 90.0 %, 3 s to go";
        let log = format!("{epoch}\n\n{STOPPING}\nstopped; continue with `tactnet train`\n");
        assert_eq!(last_progress_in(&log), epoch);
        assert_eq!(last_progress_in(&format!("\n{STOPPING}\n")), "");
    }

    fn planned(name: &str, settings: &[&str]) -> (tempfile::TempDir, ExperimentDir) {
        let folder = tempfile::tempdir().unwrap();
        let settings: Vec<String> = settings.iter().map(|s| s.to_string()).collect();
        let recipe = ExperimentRecipe::load(name, &settings).unwrap();
        let dir = ExperimentDir::create(&folder.path().join("out"), &recipe, "call").unwrap();
        (folder, dir)
    }

    #[test]
    fn every_built_in_experiment_can_be_planned() {
        for (name, tasks) in [
            ("crossval_tactnet2", 30),
            ("thesis_against_fast", 12),
            ("crossval_baselines", 55),
            ("leave_block_out", 30),
            ("sequence_length", 60),
            ("adversarial", 21),
            ("hyperparameters", 23),
            ("nshot", 100),
            ("sample_efficiency", 100),
            ("differentiate", 10),
            ("unknown", 20),
            ("sequential", 10),
            ("enrolment", 20),
            ("feature_maps", 2),
        ] {
            let (_folder, dir) = planned(name, &[]);
            assert_eq!(dir.plan.tasks.len(), tasks, "{name}");
            assert!(
                dir.plan
                    .tasks
                    .iter()
                    .all(|task| dir.state(task) == TaskState::Open)
            );
        }
    }

    #[test]
    fn a_search_draws_the_same_recipes_again_and_judges_them_inside() {
        let settings = ["search.trials=3", "seed=5"];
        let (_first, first) = planned("hyperparameters", &settings);
        let (_second, second) = planned("hyperparameters", &settings);
        let text = |dir: &ExperimentDir, trial: usize| {
            fs::read_to_string(dir.path().join(format!("recipes/trial{trial:02}.toml"))).unwrap()
        };
        assert_eq!(text(&first, 2), text(&second, 2));
        assert_ne!(text(&first, 1), text(&first, 2));
        for task in &first.plan.tasks {
            let Job::Train(spec) = &task.job else {
                panic!("a training");
            };
            assert_eq!(spec.inner, Some(0), "{spec}");
        }
    }

    #[test]
    fn what_was_interrupted_early_starts_over_and_later_is_resumed() {
        let (_folder, dir) = planned("crossval_baselines", &["folds=1"]);
        let task = &dir.plan.tasks[2];
        fs::create_dir(dir.task_dir(task)).unwrap();
        assert_eq!(dir.state(task), TaskState::Interrupted);
        assert_eq!(
            dir.begin(task).unwrap(),
            Start::Begin(Box::new(task.job.clone()))
        );
        assert_eq!(dir.state(task), TaskState::Open, "the remains are gone");
        fs::create_dir(dir.task_dir(task)).unwrap();
        fs::write(dir.task_dir(task).join("config.json"), "{}").unwrap();
        assert_eq!(dir.begin(task).unwrap(), Start::Resume);
    }

    #[test]
    fn many_may_plan_the_same_at_once_and_strangers_are_refused() {
        let recipe = ExperimentRecipe::load("crossval_baselines", &["folds=1".into()]).unwrap();
        let plan = |out: &Path| ExperimentDir::create(out, &recipe, "call");
        for _ in 0..50 {
            let folder = tempfile::tempdir().unwrap();
            let out = folder.path().join("out");
            std::thread::scope(|scope| {
                let planners: Vec<_> = (0..4).map(|_| scope.spawn(|| plan(&out))).collect();
                for planner in planners {
                    planner.join().unwrap().unwrap();
                }
            });
        }
        let folder = tempfile::tempdir().unwrap();
        // Files that a killed planner left behind.
        for name in [LOCK, ".writing-killed"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        plan(folder.path()).unwrap();
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("thesis.tex"), "").unwrap();
        assert!(plan(folder.path()).is_err());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "untouched");
    }

    #[test]
    fn every_task_computes_on_the_device_of_the_recipe() {
        for name in ["crossval_baselines", "nshot"] {
            let (_folder, mut dir) = planned(name, &["device=vulkan"]);
            for task in &mut dir.plan.tasks {
                assert_eq!(
                    task.job.spec_mut().device,
                    tactnet_models::Compute::Vulkan,
                    "{}",
                    task.id
                );
            }
        }
    }

    #[test]
    fn a_plan_of_another_version_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let plan = r#"{"schema_version": 3, "recipe": {"study": null}, "tasks": []}"#;
        fs::write(folder.path().join("experiment.json"), plan).unwrap();
        let refused = ExperimentDir::open(folder.path()).unwrap_err().to_string();
        assert!(
            refused.contains("schema version 3, this one has 4"),
            "{refused}"
        );
        assert!(!refused.contains('\n'), "{refused}");
    }

    #[test]
    fn finished_networks_of_an_interrupted_question_stay() {
        let (_folder, dir) = planned("unknown", &["splits=1"]);
        let task = &dir.plan.tasks[0];
        let networks = dir.task_dir(task).join("networks");
        fs::create_dir_all(&networks).unwrap();
        assert_eq!(
            dir.begin(task).unwrap(),
            Start::Begin(Box::new(task.job.clone()))
        );
        assert!(networks.exists());
    }

    #[test]
    fn names_that_collide_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let settings = ["models=[\"fast\", \"fast\"]".to_string()];
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        let refused = ExperimentDir::create(folder.path(), &recipe, "call")
            .unwrap_err()
            .to_string();
        assert!(refused.contains("two tasks would be called"), "{refused}");
    }
}
