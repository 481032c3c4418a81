//! An experiment as a list of idempotent tasks, and the folder that they leave their results in.
//!
//! | file | content |
//! |---|---|
//! | `experiment.json` | recipe and tasks, written first |
//! | `recipes/NAME.toml` | recipes of models that the experiment makes itself |
//! | `tasks/ID/` | the run directory of a task; it has ended when its `result.json` is there |
//! | `tasks/ID.log` | what the task said |
//! | `summary.json`, `report.html` | what was found |

use std::fs;
use std::path::{Path, PathBuf};

use rand::RngExt;
use serde::{Deserialize, Serialize};
use tactnet_data::Seed;
use tactnet_pipeline::{Levels, ModelRecipe, RunDir};
use toml::{Table, Value};

use crate::recipe::{Range, set};
use crate::{ExperimentError, ExperimentRecipe, Probe, Split};

/// One training with its evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Name of its folder.
    pub id: String,
    /// Arguments of `tactnet`; the folder is added.
    pub arguments: Vec<String>,
    /// What it is a probe for, if it is one.
    pub probe: Option<Probe>,
}

/// What `experiment.json` holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of this layout, [`Plan::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The recipe, with all that was set on the command line.
    pub recipe: ExperimentRecipe,
    /// The call that leads here.
    pub command: String,
    /// In the order they are run.
    pub tasks: Vec<Task>,
}

impl Plan {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 1;
}

/// Where a task stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum TaskState {
    /// Nothing of it has run.
    Open,
    /// A process works on it.
    Running,
    /// It was begun, and nobody works on it.
    Interrupted,
    /// It has ended.
    Done,
}

/// The folder of an experiment.
#[derive(Debug, Clone)]
pub struct ExperimentDir {
    path: PathBuf,
    /// Recipe and tasks.
    pub plan: Plan,
}

impl ExperimentDir {
    /// Plans `recipe` in a folder, or opens the folder where the same was planned before.
    ///
    /// # Errors
    /// A folder that holds another experiment or anything else; a model's recipe that cannot be used.
    pub fn create(
        path: &Path,
        recipe: &ExperimentRecipe,
        command: &str,
    ) -> Result<Self, ExperimentError> {
        let file = path.join("experiment.json");
        if file.exists() {
            let known = Self::open(path)?;
            if known.plan.recipe != *recipe {
                return Err(ExperimentError::Folder {
                    path: path.into(),
                    reason: "holds another experiment; name another folder with `--out`".into(),
                });
            }
            return Ok(known);
        }
        let failed = |error| ExperimentError::io(path, "make the experiment's folder", error);
        fs::create_dir_all(path.join("recipes")).map_err(failed)?;
        fs::create_dir_all(path.join("tasks")).map_err(failed)?;
        let path = &path.canonicalize().map_err(failed)?;
        let plan = Plan {
            schema_version: Plan::SCHEMA_VERSION,
            tasks: plan(recipe, path)?,
            recipe: recipe.clone(),
            command: command.into(),
        };
        write_json(&file, &plan)?;
        Ok(Self {
            path: path.clone(),
            plan,
        })
    }

    /// Opens a planned experiment.
    ///
    /// # Errors
    /// No experiment there, or one of another version.
    pub fn open(path: &Path) -> Result<Self, ExperimentError> {
        let file = path.join("experiment.json");
        if !file.exists() {
            return Err(ExperimentError::Folder {
                path: path.into(),
                reason: "no experiment here (no experiment.json); name a folder that `tactnet experiment run` made".into(),
            });
        }
        let text =
            fs::read_to_string(&file).map_err(|error| ExperimentError::io(&file, "read", error))?;
        let plan: Plan = serde_json::from_str(&text).map_err(|error| ExperimentError::Folder {
            path: file.clone(),
            reason: error.to_string(),
        })?;
        if plan.schema_version != Plan::SCHEMA_VERSION {
            return Err(ExperimentError::Folder {
                path: file,
                reason: format!(
                    "expected schema version {}, found {}",
                    Plan::SCHEMA_VERSION,
                    plan.schema_version
                ),
            });
        }
        let path = path
            .canonicalize()
            .map_err(|error| ExperimentError::io(path, "find", error))?;
        Ok(Self { path, plan })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// A task's run directory.
    pub fn task_dir(&self, task: &Task) -> PathBuf {
        self.path.join("tasks").join(&task.id)
    }

    /// What a task said.
    pub fn log_file(&self, task: &Task) -> PathBuf {
        self.path.join("tasks").join(format!("{}.log", task.id))
    }

    /// Where a task stands.
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

    /// Arguments of `tactnet` that run the task from where it stands. What an interrupted task left before its configuration
    /// was written is removed.
    ///
    /// # Errors
    /// Remains that cannot be removed.
    pub fn arguments(&self, task: &Task) -> Result<Vec<String>, ExperimentError> {
        let folder = self.task_dir(task);
        let shown = folder.display().to_string();
        if folder.join("config.json").exists() {
            return Ok(["train", "--resume", &shown].map(String::from).to_vec());
        }
        if folder.exists() {
            fs::remove_dir_all(&folder)
                .map_err(|error| ExperimentError::io(&folder, "remove the remains of", error))?;
        }
        let mut arguments = task.arguments.clone();
        arguments.extend(["--out".into(), shown]);
        Ok(arguments)
    }

    /// The last line of a task's log.
    pub fn last_words(&self, task: &Task) -> String {
        let log = fs::read_to_string(self.log_file(task)).unwrap_or_default();
        let line = log.lines().rev().find(|line| !line.trim().is_empty());
        line.unwrap_or("it said nothing").trim().into()
    }

    /// Writes `value` into the folder as JSON, whole or not at all.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), ExperimentError> {
        write_json(&self.path.join(name), value)
    }

    /// Writes a file into the folder, whole or not at all.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), ExperimentError> {
        tactnet_pipeline::write_whole(&self.path.join(name), bytes).map_err(ExperimentError::from)
    }
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), ExperimentError> {
    let mut text = serde_json::to_string_pretty(value)
        .unwrap_or_else(|error| panic!("what an experiment writes is always valid JSON: {error}"));
    text.push('\n');
    tactnet_pipeline::write_whole(path, text.as_bytes()).map_err(ExperimentError::from)
}

/// A model of the experiment: what it is called and what `--recipe` gets.
struct Model {
    name: String,
    recipe: String,
    inner: Option<usize>,
}

fn plan(recipe: &ExperimentRecipe, path: &Path) -> Result<Vec<Task>, ExperimentError> {
    let mut models = Vec::new();
    for name in &recipe.models {
        let source = match recipe.variants.iter().find(|variant| variant.name == *name) {
            None => {
                ModelRecipe::load(name)?;
                absolute(name)
            }
            Some(variant) => {
                let settings = variant
                    .set
                    .iter()
                    .map(|(path, value)| (path.as_str(), value.clone()));
                write_variant(path, name, &variant.base, settings)?
            }
        };
        models.push(Model {
            name: stem(name),
            recipe: source,
            inner: None,
        });
    }
    if let Some(search) = &recipe.search {
        for trial in 0..search.trials {
            let name = format!("trial{trial:02}");
            let mut rng = Seed(recipe.seed).rng(("hyperparameters", trial));
            let drawn: Vec<(&str, Value)> = search
                .space
                .iter()
                .map(|(path, range)| (path.as_str(), draw(range, rng.random())))
                .collect();
            let source = write_variant(path, &name, &search.base, drawn.into_iter())?;
            models.push(Model {
                name,
                recipe: source,
                inner: Some(0),
            });
        }
    }
    let mut tasks = Vec::new();
    let lengths: Vec<Option<usize>> = if recipe.steps.is_empty() {
        vec![None]
    } else {
        recipe.steps.iter().copied().map(Some).collect()
    };
    // Fold by fold, so that an experiment that is looked at early has the same folds of every model.
    for run in 0..recipe.runs {
        for fold in 0..recipe.folds {
            for data in &recipe.data {
                for &levels in &recipe.levels {
                    for &steps in &lengths {
                        for &split in &recipe.split {
                            let setting = Setting {
                                recipe,
                                data,
                                levels,
                                steps,
                                split,
                                run,
                                fold,
                            };
                            // Only random folds are dealt anew in every run.
                            if run > 0 && split != Split::KFold {
                                continue;
                            }
                            for probe in &recipe.probes {
                                tasks.push(setting.probe(*probe));
                            }
                            for model in &models {
                                tasks.push(setting.task(model)?);
                            }
                        }
                    }
                }
            }
        }
    }
    let mut names: Vec<&str> = tasks.iter().map(|task| task.id.as_str()).collect();
    names.sort_unstable();
    if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(ExperimentError::Recipe {
            origin: recipe.name.clone(),
            reason: format!(
                "two tasks would be called `{}`; give models and data sets different names",
                twice[0]
            ),
        });
    }
    Ok(tasks)
}

struct Setting<'a> {
    recipe: &'a ExperimentRecipe,
    data: &'a str,
    levels: Levels,
    steps: Option<usize>,
    split: Split,
    run: usize,
    fold: usize,
}

impl Setting<'_> {
    fn arguments(&self, recipe: &str) -> Vec<String> {
        let mut arguments: Vec<String> = vec!["train".into()];
        let mut add = |flag: &str, value: String| arguments.extend([flag.into(), value]);
        add("--data", absolute(self.data));
        add("--recipe", recipe.into());
        if !self.levels.are_kept() {
            add("--levels", "removed".into());
        }
        if let Some(steps) = self.steps {
            add("--steps", steps.to_string());
        }
        add("--split", self.split.name().into());
        add("--run", self.run.to_string());
        add("--fold", self.fold.to_string());
        add("--seed", self.recipe.seed.to_string());
        arguments
    }

    fn id(&self, model: &str) -> String {
        let levels = if self.levels.are_kept() {
            ""
        } else {
            "-no_levels"
        };
        let steps = self
            .steps
            .map_or(String::new(), |steps| format!("-{steps}_steps"));
        let data = stem(self.data);
        match self.split {
            Split::KFold => format!(
                "{data}-{model}{levels}{steps}-run{}-fold{}",
                self.run, self.fold
            ),
            Split::TestFlag => format!("{data}-{model}{levels}{steps}-test_flag{}", self.fold),
            Split::LeaveBlockOut => format!("{data}-{model}{levels}{steps}-block{}", self.fold),
        }
    }

    fn task(&self, model: &Model) -> Result<Task, ExperimentError> {
        let mut arguments = self.arguments(&model.recipe);
        if let Some(part) = model.inner {
            arguments.extend(["--inner".into(), part.to_string()]);
        }
        let is_network = matches!(ModelRecipe::load(&model.recipe)?, ModelRecipe::TactNet2(_));
        if let Some(epochs) = self.recipe.epochs.filter(|_| is_network) {
            arguments.extend(["--epochs".into(), epochs.to_string()]);
        }
        Ok(Task {
            id: self.id(&model.name),
            arguments,
            probe: None,
        })
    }

    fn probe(&self, probe: Probe) -> Task {
        let (name, arguments) = match probe {
            Probe::Means => ("probe_means", self.arguments("means")),
            Probe::Permuted => {
                let mut arguments = self.arguments("minirocket");
                arguments.push("--permute-labels".into());
                ("probe_permuted", arguments)
            }
        };
        Task {
            id: self.id(name),
            arguments,
            probe: Some(probe),
        }
    }
}

/// Writes `recipes/NAME.toml`, made from `base`; gives its path.
fn write_variant<'a>(
    folder: &Path,
    name: &str,
    base: &str,
    settings: impl Iterator<Item = (&'a str, Value)>,
) -> Result<String, ExperimentError> {
    let refused = |reason: String| ExperimentError::Recipe {
        origin: format!("variant `{name}`"),
        reason,
    };
    let text = ModelRecipe::load(base)?.to_toml();
    let mut table: Table = text
        .parse()
        .map_err(|e: toml::de::Error| refused(e.to_string()))?;
    set(&mut table, "name", Value::String(name.into())).map_err(refused)?;
    for (path, value) in settings {
        set(&mut table, path, value).map_err(refused)?;
    }
    let text = toml::to_string(&table).map_err(|error| refused(error.to_string()))?;
    ModelRecipe::parse(name, &text)?;
    let path = folder.join("recipes").join(format!("{name}.toml"));
    tactnet_pipeline::write_whole(&path, text.as_bytes())?;
    Ok(path.display().to_string())
}

/// A draw from a range; `share` is uniform in `[0, 1)`.
fn draw(range: &Range, share: f64) -> Value {
    match range {
        Range::Uniform { low, high } => Value::Float(low + (high - low) * share),
        Range::Logarithmic { low, high } => {
            Value::Float((low.ln() + (high.ln() - low.ln()) * share).exp())
        }
        Range::Choice { values } => values[(share * values.len() as f64) as usize].clone(),
    }
}

/// A file by its whole path, since tasks may run elsewhere; a name stays.
fn absolute(name: &str) -> String {
    if name == "twin" || ModelRecipe::built_in_names().any(|known| known == name) {
        return name.into();
    }
    let path = Path::new(name);
    path.canonicalize()
        .ok()
        .filter(|_| path.is_file())
        .map_or_else(|| name.to_string(), |path| path.display().to_string())
}

/// A file's name without folder and ending, with nothing that a file name should not have.
fn stem(name: &str) -> String {
    let stem = Path::new(name)
        .file_stem()
        .map_or_else(|| name.into(), |stem| stem.to_string_lossy());
    stem.chars()
        .map(|c| {
            if c.is_alphanumeric() || "-_.".contains(c) {
                c
            } else {
                '_'
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
            ("crossval_baselines", 45),
            ("leave_block_out", 30),
            ("sequence_length", 60),
            ("hyperparameters", 22),
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
        let trials = first
            .plan
            .tasks
            .iter()
            .filter(|task| task.id.contains("trial"));
        for task in trials {
            assert!(
                task.arguments.join(" ").ends_with("--inner 0"),
                "{:?}",
                task.arguments
            );
        }
    }

    #[test]
    fn what_was_interrupted_early_starts_over_and_later_is_resumed() {
        let (_folder, dir) = planned("crossval_baselines", &["folds=1"]);
        let task = &dir.plan.tasks[2];
        fs::create_dir(dir.task_dir(task)).unwrap();
        assert_eq!(dir.state(task), TaskState::Interrupted);
        assert_eq!(dir.arguments(task).unwrap()[0..2], ["train", "--data"]);
        assert_eq!(dir.state(task), TaskState::Open, "the remains are gone");
        fs::create_dir(dir.task_dir(task)).unwrap();
        fs::write(dir.task_dir(task).join("config.json"), "{}").unwrap();
        assert_eq!(dir.arguments(task).unwrap()[0..2], ["train", "--resume"]);
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
