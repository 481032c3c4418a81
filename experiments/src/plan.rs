//! From a recipe to a list of idempotent tasks.

use std::collections::BTreeMap;
use std::path::Path;

use rand::RngExt;
use serde::{Deserialize, Serialize};
use tactnet_data::Seed;
use tactnet_pipeline::{MeanRemoval, ModelRecipe};
use toml::{Table, Value};

use crate::recipe::{Range, set};
use crate::{
    ExperimentError, ExperimentRecipe, Probe, Split, Study, StudySettings, StudyTask,
    TransferMethod,
};

/// One training with its evaluation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Name of its folder.
    pub id: String,
    /// What its model is called in this experiment.
    pub model: String,
    /// Arguments of `tactnet`; the folder is added, and a recipe of the experiment's own is named relative to it.
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
    /// Recipes of models that do not ship with the binary, as TOML by name.
    pub recipes: BTreeMap<String, String>,
    /// In the order they are run.
    pub tasks: Vec<Task>,
}

impl Plan {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 3;
    /// Before the file name of a recipe of the experiment's own.
    pub(crate) const OWN_RECIPE: &str = "recipes:";

    /// Plans `recipe`.
    ///
    /// # Errors
    /// A data set that is not there, a model's recipe that cannot be used, two models of one name.
    pub fn new(recipe: &ExperimentRecipe, command: &str) -> Result<Self, ExperimentError> {
        let refused = |reason: String| ExperimentError::Recipe {
            origin: recipe.name.clone(),
            reason,
        };
        if let Some(missing) = recipe
            .data
            .iter()
            .find(|data| *data != "twin" && !Path::new(data).exists())
        {
            return Err(refused(format!("data `{missing}`: no such file")));
        }
        let mut recipes = BTreeMap::new();
        let models = models(recipe, &mut recipes)?;
        let tasks = match &recipe.study {
            None => tasks(recipe, &models),
            Some(study) => {
                if let Some(model) = models.iter().find(|model| !model.is_network) {
                    return Err(refused(format!(
                        "model `{}`: a study needs networks",
                        model.name
                    )));
                }
                study_tasks(recipe, study, &models)
            }
        };
        let mut names: Vec<&str> = tasks.iter().map(|task| task.id.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(refused(format!(
                "two tasks would be called `{}`; name every model, data set and split once",
                twice[0]
            )));
        }
        Ok(Self {
            schema_version: Self::SCHEMA_VERSION,
            recipe: recipe.clone(),
            command: command.into(),
            recipes,
            tasks,
        })
    }

    /// What keeps `other` from going on with this plan, if anything does.
    pub(crate) fn difference(&self, other: &Self) -> Option<String> {
        let [own, theirs] =
            [self, other].map(|plan| toml::Table::try_from(&plan.recipe).unwrap_or_default());
        let names = own.keys().chain(theirs.keys());
        for name in names {
            let (a, b) = (own.get(name), theirs.get(name));
            if a != b {
                let shown =
                    |value: Option<&Value>| value.map_or("nothing".into(), ToString::to_string);
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

/// A model of the experiment.
struct Model {
    name: String,
    /// What `--recipe` gets.
    recipe: String,
    is_network: bool,
    inner: Option<usize>,
}

fn models(
    recipe: &ExperimentRecipe,
    recipes: &mut BTreeMap<String, String>,
) -> Result<Vec<Model>, ExperimentError> {
    // Where settings are searched for, everything is judged inside the training sweeps.
    let inner = recipe.search.as_ref().map(|_| 0);
    let mut models = Vec::new();
    let mut own = |name: String, text: String, is_network: bool| {
        let recipe = format!("{}{name}.toml", Plan::OWN_RECIPE);
        recipes.insert(name.clone(), text);
        Model {
            name,
            recipe,
            is_network,
            inner,
        }
    };
    for name in &recipe.models {
        let variant = recipe.variants.iter().find(|variant| variant.name == *name);
        let is_network = |recipe: &ModelRecipe| matches!(recipe, ModelRecipe::TactNet2(_));
        models.push(match variant {
            Some(variant) => {
                let settings = variant
                    .set
                    .iter()
                    .map(|(path, value)| (path.as_str(), value.clone()));
                let (text, made) = made_from(name, name, &variant.base, settings)?;
                own(name.clone(), text, is_network(&made))
            }
            None => {
                let loaded = ModelRecipe::load(name)?;
                if ModelRecipe::built_in_names().any(|known| known == name) {
                    Model {
                        name: name.clone(),
                        recipe: name.clone(),
                        is_network: is_network(&loaded),
                        inner,
                    }
                } else {
                    own(stem(name), loaded.to_toml(), is_network(&loaded))
                }
            }
        });
    }
    if let Some(search) = &recipe.search {
        for trial in 0..search.trials {
            let mut rng = Seed(recipe.seed).rng(("hyperparameters", trial));
            let drawn: Vec<(&str, Value)> = search
                .space
                .iter()
                .map(|(path, range)| (path.as_str(), draw(range, rng.random())))
                .collect();
            let name = format!("trial{trial:02}");
            let title = drawn.iter().fold(name.clone(), |title, (path, value)| {
                let setting = path.rsplit('.').next().unwrap_or(path);
                format!("{title}, {setting} {}", short(value))
            });
            let (text, made) = made_from(&name, &title, &search.base, drawn.into_iter())?;
            let is_network = matches!(made, ModelRecipe::TactNet2(_));
            let model = own(name, text, is_network);
            models.push(model);
        }
    }
    Ok(models)
}

fn tasks(recipe: &ExperimentRecipe, models: &[Model]) -> Vec<Task> {
    let lengths = lengths(recipe);
    let mut tasks = Vec::new();
    // Fold by fold, so that an experiment that is looked at early has the same folds of every model.
    for repeat in 0..recipe.repeats {
        for fold in 0..recipe.folds {
            for data in &recipe.data {
                for &levels in &recipe.levels {
                    for &steps in &lengths {
                        for &split in &recipe.split {
                            // Only random folds are dealt anew in every repeat, and the author's split has one fold.
                            let once = repeat > 0 && split != Split::KFold;
                            if once || fold > 0 && split == Split::TestFlag {
                                continue;
                            }
                            let setting = GridPoint {
                                recipe,
                                data,
                                levels,
                                steps,
                                split,
                                repeat,
                                fold,
                            };
                            tasks.extend(recipe.probes.iter().map(|probe| setting.probe(*probe)));
                            tasks.extend(models.iter().map(|model| setting.task(model)));
                        }
                    }
                }
            }
        }
    }
    tasks
}

/// A task for every split (of the materials, or of the sweeps), data set and network.
fn study_tasks(recipe: &ExperimentRecipe, study: &StudySettings, models: &[Model]) -> Vec<Task> {
    let numbers: Vec<usize> = match recipe.splits {
        Some(splits) => (0..splits).collect(),
        None if study.kind.draws_materials() => vec![0],
        None => (0..recipe.repeats)
            .flat_map(|repeat| (0..recipe.folds).map(move |fold| 5 * repeat + fold))
            .collect(),
    };
    let methods = if recipe.methods.is_empty() && study.kind == Study::Nshot {
        TransferMethod::ALL.to_vec()
    } else {
        recipe.methods.clone()
    };
    let mut tasks = Vec::new();
    for &number in &numbers {
        for data in &recipe.data {
            for &levels in &recipe.levels {
                for steps in lengths(recipe) {
                    for model in models {
                        let task = StudyTask {
                            study: study.kind,
                            number,
                            seed: recipe.seed,
                            shots: recipe.shots.clone(),
                            methods: methods.clone(),
                            new_materials: study.new_materials,
                            scratch_folds: study.scratch_folds,
                        };
                        tasks.push(study_task(recipe, data, levels, steps, model, &task));
                    }
                }
            }
        }
    }
    tasks
}

fn study_task(
    recipe: &ExperimentRecipe,
    data: &str,
    levels: MeanRemoval,
    steps: Option<usize>,
    model: &Model,
    task: &StudyTask,
) -> Task {
    let text = serde_json::to_string(task)
        .unwrap_or_else(|error| panic!("a study's task is always valid JSON: {error}"));
    let mut arguments: Vec<String> = vec!["study".into()];
    let mut add = |flag: &str, value: String| arguments.extend([flag.into(), value]);
    add("--data", absolute(data));
    add("--recipe", model.recipe.clone());
    add("--levels", levels.name().into());
    if let Some(steps) = steps {
        add("--steps", steps.to_string());
    }
    if let Some(epochs) = recipe.epochs {
        add("--epochs", epochs.to_string());
    }
    add("--task", text);
    let setting = GridPoint {
        recipe,
        data,
        levels,
        steps,
        split: Split::KFold,
        repeat: 0,
        fold: 0,
    };
    Task {
        id: setting.study_id(&model.name, task),
        model: model.name.clone(),
        arguments,
        probe: None,
    }
}

/// Time steps kept of every sweep, one after the other; `None`: all.
fn lengths(recipe: &ExperimentRecipe) -> Vec<Option<usize>> {
    if recipe.steps.is_empty() {
        vec![None]
    } else {
        recipe.steps.iter().copied().map(Some).collect()
    }
}

struct GridPoint<'a> {
    recipe: &'a ExperimentRecipe,
    data: &'a str,
    levels: MeanRemoval,
    steps: Option<usize>,
    split: Split,
    repeat: usize,
    fold: usize,
}

impl GridPoint<'_> {
    fn arguments(&self, recipe: &str) -> Vec<String> {
        let mut arguments: Vec<String> = vec!["train".into()];
        let mut add = |flag: &str, value: String| arguments.extend([flag.into(), value]);
        add("--data", absolute(self.data));
        add("--recipe", recipe.into());
        add("--levels", self.levels.name().into());
        if let Some(steps) = self.steps {
            add("--steps", steps.to_string());
        }
        add("--split", self.split.name().into());
        add("--repeat", self.repeat.to_string());
        add("--fold", self.fold.to_string());
        add("--seed", self.recipe.seed.to_string());
        arguments
    }

    /// Data set, model, levels and steps, as they stand in a name: before and behind the model.
    fn parts(&self) -> [String; 2] {
        let levels = if self.levels.is_none() {
            ""
        } else {
            "-no_levels"
        };
        let steps = self
            .steps
            .map_or(String::new(), |steps| format!("-{steps}_steps"));
        [stem(self.data), format!("{levels}{steps}")]
    }

    fn id(&self, model: &str) -> String {
        let [data, rest] = self.parts();
        match self.split {
            Split::KFold => format!("{data}-{model}{rest}-run{}-fold{}", self.repeat, self.fold),
            Split::TestFlag => format!("{data}-{model}{rest}-test_flag"),
            Split::LeaveBlockOut => format!("{data}-{model}{rest}-block{}", self.fold),
        }
    }

    fn study_id(&self, model: &str, task: &StudyTask) -> String {
        let [data, rest] = self.parts();
        format!(
            "{data}-{model}{rest}-{}-{:03}",
            task.study.name(),
            task.number
        )
    }

    fn task(&self, model: &Model) -> Task {
        let mut arguments = self.arguments(&model.recipe);
        if let Some(part) = model.inner {
            arguments.extend(["--inner".into(), part.to_string()]);
        }
        if let Some(epochs) = self.recipe.epochs.filter(|_| model.is_network) {
            arguments.extend(["--epochs".into(), epochs.to_string()]);
        }
        Task {
            id: self.id(&model.name),
            model: model.name.clone(),
            arguments,
            probe: None,
        }
    }

    fn probe(&self, probe: Probe) -> Task {
        let (name, model, arguments) = match probe {
            Probe::Means => (
                "probe_means",
                "probe: nearest taxel means",
                self.arguments("means"),
            ),
            Probe::Permuted => {
                let mut arguments = self.arguments("minirocket");
                arguments.push("--permute-labels".into());
                (
                    "probe_permuted",
                    "probe: permuted labels (minirocket)",
                    arguments,
                )
            }
        };
        Task {
            id: self.id(name),
            model: model.into(),
            arguments,
            probe: Some(probe),
        }
    }
}

/// A recipe made from `base`: as TOML, and parsed.
///
/// - `title`: what the recipe calls itself
fn made_from<'a>(
    name: &str,
    title: &str,
    base: &str,
    settings: impl Iterator<Item = (&'a str, Value)>,
) -> Result<(String, ModelRecipe), ExperimentError> {
    let refused = |reason: String| ExperimentError::Recipe {
        origin: format!("variant `{name}`"),
        reason,
    };
    let text = ModelRecipe::load(base)?.to_toml();
    let mut table: Table = text
        .parse()
        .map_err(|e: toml::de::Error| refused(e.message().into()))?;
    set(&mut table, "name", Value::String(title.into())).map_err(refused)?;
    for (path, value) in settings {
        set(&mut table, path, value).map_err(refused)?;
    }
    let text = toml::to_string(&table).map_err(|error| refused(error.to_string()))?;
    let recipe = ModelRecipe::parse(name, &text)?;
    Ok((text, recipe))
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

/// A value as people read it.
fn short(value: &Value) -> String {
    match value {
        Value::Float(number) if number.abs() < 0.01 => format!("{number:.1e}"),
        Value::Float(number) => format!("{number:.2}"),
        other => other.to_string(),
    }
}

/// A file by its whole path, since tasks may run elsewhere; a name stays.
fn absolute(name: &str) -> String {
    let path = Path::new(name);
    path.canonicalize()
        .ok()
        .filter(|_| name != "twin" && path.is_file())
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
