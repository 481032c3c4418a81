//! The models of an experiment: built-in recipes, files, variants, and randomly drawn recipes.

use std::collections::BTreeMap;

use rand::RngExt;
use tactnet_data::Seed;
use tactnet_pipeline::ModelRecipe;
use toml::{Table, Value};

use super::{Plan, stem};
use crate::recipe::{Range, Search};
use crate::settings::set;
use crate::{ExperimentError, ExperimentRecipe};

/// A model of the experiment.
pub(super) struct Model {
    pub(super) name: String,
    /// Name of a built-in recipe, or file name of a recipe of the experiment.
    pub(super) recipe: String,
    pub(super) loaded: ModelRecipe,
    /// Part of the training sweeps that it is evaluated on; `None` for the test sweeps.
    pub(super) inner: Option<usize>,
}

impl Model {
    /// Returns true for a network.
    pub(super) fn is_network(&self) -> bool {
        matches!(self.loaded, ModelRecipe::Network(_))
    }

    /// Returns true if the number of epochs of an experiment applies to the model.
    pub(super) fn has_epochs(&self) -> bool {
        !matches!(self.loaded, ModelRecipe::Baseline(_))
    }
}

/// Loads the models of a recipe and adds those that are not built in to `recipes`, as TOML by name.
///
/// # Errors
/// A missing or invalid recipe.
pub(super) fn models(
    recipe: &ExperimentRecipe,
    recipes: &mut BTreeMap<String, String>,
) -> Result<Vec<Model>, ExperimentError> {
    // A search evaluates all models on a part of the training sweeps.
    let inner = recipe.search.as_ref().map(|_| 0);
    let mut models = Vec::new();
    let mut own = |name: String, text: String, loaded: ModelRecipe| {
        let recipe = format!("{}{name}.toml", Plan::OWN_RECIPE);
        recipes.insert(name.clone(), text);
        Model {
            name,
            recipe,
            loaded,
            inner,
        }
    };
    for name in &recipe.models {
        let variant = recipe.variants.iter().find(|variant| variant.name == *name);
        models.push(match variant {
            Some(variant) => {
                let settings = variant
                    .set
                    .iter()
                    .map(|(path, value)| (path.as_str(), value.clone()));
                let (text, made) = made_from(name, name, &variant.base, settings)?;
                own(name.clone(), text, made)
            }
            None => {
                let loaded = ModelRecipe::load(name)?;
                if ModelRecipe::built_in_names().any(|known| known == name) {
                    Model {
                        name: name.clone(),
                        recipe: name.clone(),
                        loaded,
                        inner,
                    }
                } else {
                    own(stem(name), loaded.to_toml(), loaded)
                }
            }
        });
    }
    if let Some(search) = &recipe.search {
        for trial in 0..search.trials {
            let name = format!("trial{trial:02}");
            let (text, made) = draw_trial(search, Seed(recipe.seed), trial, &name)?;
            let model = own(name, text, made);
            models.push(model);
        }
    }
    Ok(models)
}

/// Draws the settings of a trial; returns its recipe as TOML and parsed. The name inside the recipe lists the settings.
fn draw_trial(
    search: &Search,
    seed: Seed,
    trial: usize,
    name: &str,
) -> Result<(String, ModelRecipe), ExperimentError> {
    let mut rng = seed.rng(("hyperparameters", trial));
    let drawn: Vec<(&str, Value)> = search
        .space
        .iter()
        .map(|(path, range)| (path.as_str(), draw(range, rng.random())))
        .collect();
    let title = drawn.iter().fold(name.to_string(), |title, (path, value)| {
        let setting = path.rsplit('.').next().unwrap_or(path);
        format!("{title}, {setting} {}", short(value))
    });
    made_from(name, &title, &search.base, drawn.into_iter())
}

/// Returns a recipe derived from `base`, as TOML and parsed.
///
/// - `title`: name inside the recipe
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

/// Returns the value of a range at `share`, which is uniform in `[0, 1)`.
fn draw(range: &Range, share: f64) -> Value {
    match range {
        Range::Uniform { low, high } => Value::Float(low + (high - low) * share),
        Range::Logarithmic { low, high } => {
            Value::Float((low.ln() + (high.ln() - low.ln()) * share).exp())
        }
        Range::Choice { values } => values[(share * values.len() as f64) as usize].clone(),
    }
}

/// Formats a value for a title.
fn short(value: &Value) -> String {
    match value {
        Value::Float(number) if number.abs() < 0.01 => format!("{number:.1e}"),
        Value::Float(number) => format!("{number:.2}"),
        other => other.to_string(),
    }
}
