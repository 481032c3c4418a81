//! Expands a recipe into a list of idempotent tasks.

mod committees;
mod data;
mod grid;
mod models;
mod suitable;

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_pipeline::{ModelRecipe, TrainSpec};
use toml::{Table, Value};

use crate::phrases::few_sweeps;
use crate::{DataProbes, ExperimentError, ExperimentRecipe, Part, Probe, Question};
pub use data::RecipeWithData;
use grid::Grid;
use suitable::{Unsuitable, leave_out_unsuitable};

/// One unit of work, run by one process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Name of its folder.
    pub id: String,
    /// Name of its model in this experiment.
    pub model: String,
    /// Its work. Recipes of the experiment itself are named relative to the experiment's folder.
    pub job: Job,
    /// Kind of probe; `None` for a contender.
    pub probe: Option<Probe>,
    /// Tasks that train the members of a committee on the same sweeps. The committee waits for them and averages their predictions.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub members: Vec<String>,
}

/// The work of a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Job {
    /// Trains one classifier and evaluates it.
    Train(TrainSpec),
    /// Answers a question for one part of the data.
    Question(QuestionTask),
}

impl Job {
    /// Returns the data set, the recipe and the settings of the training or of the question's networks.
    pub(crate) fn spec_mut(&mut self) -> &mut TrainSpec {
        match self {
            Self::Train(spec) => spec,
            Self::Question(task) => &mut task.networks,
        }
    }
}

/// A question about one part of a data set, with everything that determines its answer except the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuestionTask {
    /// The question with its fields.
    pub question: Question,
    /// The part of the data.
    pub part: Part,
    /// The data set and the training settings of networks; the question decides on folds and labels.
    pub networks: TrainSpec,
}

/// Content of `experiment.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Version of this layout, [`Plan::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The recipe, with all settings applied.
    pub recipe: ExperimentRecipe,
    /// Command that repeats the experiment; the front end provides it.
    pub command: String,
    /// Recipes of models that are not built in, as TOML by name.
    pub recipes: BTreeMap<String, String>,
    /// Tasks in the order in which they run.
    pub tasks: Vec<Task>,
    /// Reasons to doubt the numbers, such as materials that were recorded in one block each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data_warnings: Vec<String>,
    /// Probes of the data sets that need no training; only for a cross-validation.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data_probes: Vec<DataProbes>,
    /// Models that cannot be trained on a data set.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOut>,
}

/// A model that an experiment leaves out, since it cannot be trained on a data set. Its text is a sentence.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct LeftOut {
    /// Name of the model.
    pub model: String,
    /// Name or file of the data set.
    pub data: String,
    /// Number of training sweeps of each material; absent for all of the fold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shots: Option<usize>,
    /// Requirement that the data set does not meet.
    pub reason: String,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let few = self.shots.map_or(String::new(), few_sweeps);
        write!(
            f,
            "{} is left out on {}{few}: {}",
            self.model, self.data, self.reason
        )
    }
}

impl Plan {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 4;
    /// Prefix of the file name of a recipe that belongs to the experiment.
    pub(crate) const OWN_RECIPE: &str = "recipes:";

    /// Plans a recipe.
    ///
    /// - `command`: command that repeats the experiment
    ///
    /// # Errors
    /// An invalid recipe of a model; two models with the same name; data that is unsuitable.
    pub fn new(data: &RecipeWithData<'_>, command: &str) -> Result<Self, ExperimentError> {
        let recipe = data.recipe;
        let refused = |reason: String| ExperimentError::Recipe {
            origin: recipe.name.clone(),
            reason,
        };
        let mut recipes = BTreeMap::new();
        let models = models::models(recipe, &mut recipes)?;
        let grid = Grid {
            recipe,
            models: &models,
            data,
        };
        let mut tasks = grid.tasks().map_err(refused)?;
        let mut names: Vec<&str> = tasks.iter().map(|task| task.id.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(refused(format!(
                "two tasks would be called `{}`; name every model, data set and split once",
                twice[0]
            )));
        }
        let suited = leave_out_unsuitable(&mut tasks, data, |spec| recipe_of(&recipes, spec));
        let left_out =
            suited.map_err(
                |Unsuitable { reason, settings }| ExperimentError::Unsuitable {
                    origin: recipe.name.clone(),
                    reason,
                    settings,
                },
            )?;
        committees::share_members(&mut tasks, &models);
        Ok(Self {
            schema_version: Self::SCHEMA_VERSION,
            recipe: recipe.clone(),
            command: command.into(),
            recipes,
            tasks,
            data_warnings: data.warnings(),
            data_probes: match recipe.question {
                Question::Crossval(_) => data.probes(),
                _ => Vec::new(),
            },
            left_out,
        })
    }

    /// Returns true if a task trains a network or answers a question about networks; false for a recipe that is no
    /// longer readable.
    pub(crate) fn trains_network(&self, task: &Task) -> bool {
        let Job::Train(spec) = &task.job else {
            return true;
        };
        matches!(
            recipe_of(&self.recipes, spec),
            Some(ModelRecipe::Network(_))
        )
    }

    /// Returns the first difference that prevents `other` from resuming this plan.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        let [own, theirs] = [self, other].map(|plan| {
            let mut fields = Table::try_from(&plan.recipe).unwrap_or_default();
            if let Some(Value::Table(question)) = fields.remove("question") {
                fields.extend(question);
            }
            fields
        });
        let names = own.keys().chain(theirs.keys());
        for name in names {
            let (a, b) = (own.get(name), theirs.get(name));
            if a != b {
                let shown =
                    |value: Option<&Value>| value.map_or("not set".into(), ToString::to_string);
                return Some(format!(
                    "its `{name}` is {}, asked for is {}",
                    shown(a),
                    shown(b)
                ));
            }
        }
        for (name, text) in &self.recipes {
            if other.recipes.get(name) != Some(text) {
                return Some(format!("the recipe of model `{name}` has changed since"));
            }
        }
        (self.tasks != other.tasks).then(|| "it was planned by another version of tactnet".into())
    }
}

/// Returns the recipe of a training, from the experiment or built in; `None` if it is no longer readable.
fn recipe_of(recipes: &BTreeMap<String, String>, spec: &TrainSpec) -> Option<ModelRecipe> {
    let own = spec.recipe.strip_prefix(Plan::OWN_RECIPE);
    match own.and_then(|file| file.strip_suffix(".toml")) {
        Some(name) => ModelRecipe::parse(name, recipes.get(name)?).ok(),
        None => ModelRecipe::load(&spec.recipe).ok(),
    }
}

/// Returns a file name without folder and extension, with unusual characters replaced by `_`.
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
