//! An experiment as a TOML file.

mod search;

use std::borrow::Cow;
use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_data::{known_names, near_name};
use tactnet_models::Compute;
use tactnet_pipeline::MeanRemoval;
use toml::{Table, Value};

use crate::one_or_many::one_or_many;
use crate::settings::{FIELDS, current_shape, parse_value, set_field};
use crate::{Crossval, ExperimentError, Question, SweepLength};
pub use search::{Range, Search};

/// Built-in experiments by name.
const BUILT_IN: [(&str, &str); 17] = [
    (
        "crossval_tactnet2",
        include_str!("../recipes/crossval_tactnet2.toml"),
    ),
    (
        "thesis_against_fast",
        include_str!("../recipes/thesis_against_fast.toml"),
    ),
    (
        "crossval_baselines",
        include_str!("../recipes/crossval_baselines.toml"),
    ),
    (
        "leave_block_out",
        include_str!("../recipes/leave_block_out.toml"),
    ),
    (
        "sequence_length",
        include_str!("../recipes/sequence_length.toml"),
    ),
    ("adversarial", include_str!("../recipes/adversarial.toml")),
    (
        "hyperparameters",
        include_str!("../recipes/hyperparameters.toml"),
    ),
    ("nshot", include_str!("../recipes/nshot.toml")),
    (
        "sample_efficiency",
        include_str!("../recipes/sample_efficiency.toml"),
    ),
    (
        "differentiate",
        include_str!("../recipes/differentiate.toml"),
    ),
    ("unknown", include_str!("../recipes/unknown.toml")),
    ("sequential", include_str!("../recipes/sequential.toml")),
    ("enrolment", include_str!("../recipes/enrolment.toml")),
    ("feature_maps", include_str!("../recipes/feature_maps.toml")),
    ("networks", include_str!("../recipes/networks.toml")),
    ("robustness", include_str!("../recipes/robustness.toml")),
    ("public", include_str!("../recipes/public.toml")),
];

/// A question about classifiers on data sets, with the expected answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentRecipe {
    /// Name of the experiment.
    pub name: String,
    /// One-line title.
    pub title: String,
    /// Result that the author expects.
    pub expects: String,
    /// Expected duration, as text.
    pub takes: String,
    /// Data sets: `twin`, files, or folders of data sets.
    #[serde(deserialize_with = "one_or_many")]
    pub data: Vec<String>,
    /// Recipes of models: built-in names, files, or names of `variants`.
    #[serde(deserialize_with = "one_or_many")]
    pub models: Vec<String>,
    /// Treatments of the mean of each taxel; each is evaluated separately.
    #[serde(default = "kept", deserialize_with = "one_or_many")]
    pub levels: Vec<MeanRemoval>,
    /// Numbers of time steps to which sweeps are cut, `"shortest"`, or `"all"` for sweeps of unequal length; each is evaluated separately. Empty
    /// for complete sweeps.
    #[serde(default, deserialize_with = "one_or_many")]
    pub steps: Vec<SweepLength>,
    /// Sample rate in Hz for data that does not state one; absent for the stated or assumed rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Seed of all random choices.
    #[serde(default = "one_seed")]
    pub seed: u64,
    /// Number of epochs for all networks, instead of their recipes' numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epochs: Option<usize>,
    /// Device for all tasks.
    #[serde(default)]
    pub device: Compute,
    /// The question with its fields; a cross-validation by default.
    #[serde(default = "crossval")]
    pub question: Question,
    /// Recipes derived from others.
    #[serde(default)]
    pub variants: Vec<Variant>,
    /// Recipes drawn at random and evaluated on the inner split.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<Search>,
}

/// A recipe derived from another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Name of the variant.
    pub name: String,
    /// Built-in name or file of the base recipe.
    pub base: String,
    /// Settings by path, such as `training.learning_rate`.
    pub set: Table,
}

fn kept() -> Vec<MeanRemoval> {
    vec![MeanRemoval::None]
}

fn crossval() -> Question {
    Question::Crossval(Crossval::default())
}

fn one_seed() -> u64 {
    1
}

impl ExperimentRecipe {
    /// Returns all built-in experiments.
    pub fn built_in() -> impl Iterator<Item = Self> {
        BUILT_IN.iter().map(|(name, text)| {
            Self::parse(name, text, &[])
                .unwrap_or_else(|error| panic!("built-in experiments are valid: {error}"))
        })
    }

    /// Returns the TOML text of a built-in experiment.
    ///
    /// # Errors
    /// An unknown name.
    pub fn built_in_text(name: &str) -> Result<&'static str, ExperimentError> {
        let found = BUILT_IN.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text).ok_or_else(|| unknown(name))
    }

    /// Loads a built-in experiment or a file and overrides some of its fields.
    ///
    /// - `settings`: `field=value`, with a value in TOML or a bare word
    ///
    /// # Errors
    /// A name that is neither known nor a readable file; invalid TOML; an unknown field; a setting out of range.
    pub fn load(name_or_path: &str, settings: &[String]) -> Result<Self, ExperimentError> {
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            return Self::parse(name, text, settings);
        }
        Self::parse(name_or_path, &text_of_file(name_or_path)?, settings)
    }

    /// Returns the text of a built-in experiment, or of a file that contains a valid experiment.
    ///
    /// # Errors
    /// See [`ExperimentRecipe::load`].
    pub fn text(name_or_path: &str) -> Result<Cow<'static, str>, ExperimentError> {
        if let Ok(text) = Self::built_in_text(name_or_path) {
            return Ok(text.into());
        }
        let text = text_of_file(name_or_path)?;
        Self::parse(name_or_path, &text, &[])?;
        Ok(text.into())
    }

    /// Parses TOML; messages name `origin`.
    ///
    /// # Errors
    /// See [`ExperimentRecipe::load`].
    pub fn parse(origin: &str, text: &str, settings: &[String]) -> Result<Self, ExperimentError> {
        let refused = |reason: String| ExperimentError::Recipe {
            origin: origin.into(),
            reason: one_line(&reason),
        };
        let mut table: Table = text
            .parse()
            .map_err(|e: toml::de::Error| refused(e.to_string()))?;
        current_shape(&mut table);
        for setting in settings {
            let (path, value) = setting
                .split_once('=')
                .ok_or_else(|| refused(format!("setting `{setting}`: expected FIELD=VALUE")))?;
            let value = parse_value(value.trim())
                .map_err(|e| refused(format!("setting `{setting}`: {e}")))?;
            set_field(&mut table, path.trim(), value).map_err(refused)?;
        }
        if let Some(Value::Table(question)) = table.get("question") {
            Question::check_fields(question)
                .map_err(|e| refused(with_near_name(&e.to_string(), &FIELDS)))?;
        }
        let recipe: Self = Value::Table(table)
            .try_into()
            .map_err(|e: toml::de::Error| refused(with_near_name(&e.to_string(), &[])))?;
        recipe.validate().map_err(refused)?;
        Ok(recipe)
    }

    /// Returns the expected result if it applies to this run, and an empty text otherwise. The text of a built-in
    /// recipe applies to all of its models, its steps, levels and question, and to TactMat or the twin.
    ///
    /// - `beside_tactmat`: true if all data sets of the run are TactMat or its twin
    pub(crate) fn expected_of_run(&self, beside_tactmat: bool) -> &str {
        let Ok(shipped) = Self::load_shipped(&self.name) else {
            return &self.expects;
        };
        let all_models = shipped
            .models
            .iter()
            .all(|model| self.models.contains(model));
        let same = (self.data == shipped.data || beside_tactmat)
            && (&self.levels, &self.steps) == (&shipped.levels, &shipped.steps)
            && self.question.subject() == shipped.question.subject();
        if self.expects == shipped.expects && !(all_models && same) {
            return "";
        }
        &self.expects
    }

    fn load_shipped(name: &str) -> Result<Self, ExperimentError> {
        Self::parse(name, Self::built_in_text(name)?, &[])
    }

    /// Checks the constraints that the types do not express.
    fn validate(&self) -> Result<(), String> {
        let plain = |name: &str| {
            !name.is_empty()
                && name
                    .chars()
                    .all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
        };
        if !plain(&self.name) {
            return Err(format!(
                "`name`: expected letters, digits, `-`, `_`, found `{}`",
                self.name
            ));
        }
        if let Some(variant) = self.variants.iter().find(|variant| !plain(&variant.name)) {
            return Err(format!(
                "`variants.name`: expected letters, digits, `-`, `_`, found `{}`",
                variant.name
            ));
        }
        for (field, empty) in [
            ("data", self.data.is_empty()),
            ("models", self.models.is_empty() && self.search.is_none()),
            ("levels", self.levels.is_empty()),
        ] {
            if empty {
                return Err(format!("`{field}`: expected at least one, found none"));
            }
        }
        if self.epochs == Some(0) {
            return Err("`epochs`: expected at least 1, found 0".into());
        }
        if let Some(rate) = self
            .rate_hz
            .filter(|rate| !(rate.is_finite() && *rate > 0.0))
        {
            return Err(format!(
                "`rate_hz`: expected a positive number of Hz, found {rate}"
            ));
        }
        self.question.ask().validate()?;
        match (&self.search, &self.question) {
            (None, _) => Ok(()),
            (Some(search), Question::Crossval(_)) => search.validate(),
            (Some(_), question) => Err(format!(
                "`search`: belongs to a cross-validation, the question is `{}`",
                question.ask().name()
            )),
        }
    }
}

/// Reads a file; a missing file is reported as an unknown name.
fn text_of_file(name: &str) -> Result<String, ExperimentError> {
    let path = Path::new(name);
    if !path.exists() {
        return Err(unknown(name));
    }
    tactnet_data::read_text(path)
        .map_err(|error| ExperimentError::io(path, "read the experiment", error))
}

fn unknown(name: &str) -> ExperimentError {
    ExperimentError::Unknown {
        name: name.into(),
        known: known_names(name, BUILT_IN.map(|(name, _)| name)),
    }
}

/// Adds the nearest known name to a serde message about an unknown field or value.
///
/// - `others`: further fields that are allowed
fn with_near_name(message: &str, others: &[&str]) -> String {
    let mut message = one_line(message);
    let Some((said, expected)) = message.split_once(", expected ") else {
        return message;
    };
    let Some(typed) = said
        .strip_prefix("unknown ")
        .and_then(|said| said.split('`').nth(1))
    else {
        return message;
    };
    let names = expected.split('`').skip(1).step_by(2);
    let meant = near_name(typed, names.chain(others.iter().copied())).map(str::to_string);
    if !others.is_empty() {
        message.push_str(&format!(", or of the recipe: {}", others.join(", ")));
    }
    if let Some(meant) = meant {
        message.push_str(&format!("; did you mean `{meant}`?"));
    }
    message
}

/// Joins the lines of a message and replaces Rust's type names by plain ones.
fn one_line(text: &str) -> String {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let line = lines.collect::<Vec<_>>().join(", ");
    [
        ("expected usize", "expected a whole number"),
        ("expected u64", "expected a whole number"),
        ("expected u32", "expected a whole number"),
        ("expected f64", "expected a number"),
    ]
    .into_iter()
    .fold(line, |line, (from, to)| line.replace(from, to))
}

#[cfg(test)]
mod tests;
