//! An experiment as one TOML file.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Deserializer, Serialize};
use tactnet_pipeline::MeanRemoval;
use toml::{Table, Value};

use crate::{ExperimentError, Study, TransferMethod};

/// Experiments that ship with the binary, by name.
const BUILT_IN: [(&str, &str); 13] = [
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
];

/// What is trained on what, and what is expected to come out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExperimentRecipe {
    /// What people call it.
    pub name: String,
    /// One line for people.
    pub title: String,
    /// What its author expects to see.
    pub expects: String,
    /// How long it takes.
    pub takes: String,
    /// Data sets: `twin`, or files.
    #[serde(deserialize_with = "one_or_many")]
    pub data: Vec<String>,
    /// Recipes of models: built-in names, files, or names of `variants`.
    #[serde(deserialize_with = "one_or_many")]
    pub models: Vec<String>,
    /// Whether levels are kept, removed, or both one after the other.
    #[serde(default = "kept", deserialize_with = "one_or_many")]
    pub levels: Vec<MeanRemoval>,
    /// How data sets are split.
    #[serde(default = "k_fold", deserialize_with = "one_or_many")]
    pub split: Vec<Split>,
    /// Folds of each repeat that are trained.
    #[serde(default = "five")]
    pub folds: usize,
    /// Repeats of the cross-validation.
    #[serde(default = "one", alias = "runs")]
    pub repeats: usize,
    /// Time steps kept of every sweep, one experiment each; empty: all.
    #[serde(default, deserialize_with = "one_or_many")]
    pub steps: Vec<usize>,
    /// Probes that run beside the models.
    #[serde(default, deserialize_with = "one_or_many")]
    pub probes: Vec<Probe>,
    /// Groups that materials are sorted into by who is confused with whom; 0: none.
    #[serde(default)]
    pub groups: usize,
    /// Names every random choice.
    #[serde(default = "one_seed")]
    pub seed: u64,
    /// Train networks this many epochs instead of their recipe's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epochs: Option<usize>,
    /// A question whose tasks are more than one training each; absent: every task trains and judges one classifier.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub study: Option<StudySettings>,
    /// With a study: how often new materials are drawn, at first once; or, where a study draws none, how many of the two times five folds
    /// are used instead of `folds` and `repeats`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splits: Option<usize>,
    /// With `nshot` and `enrolment`: sweeps of every new material that are learnt from. With `differentiate`, `unknown` and `sequential`:
    /// sweeps behind one decision.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub shots: Vec<usize>,
    /// With `nshot`: methods of transfer.
    #[serde(
        default,
        skip_serializing_if = "Vec::is_empty",
        deserialize_with = "one_or_many"
    )]
    pub methods: Vec<TransferMethod>,
    /// Recipes made from others.
    #[serde(default)]
    pub variants: Vec<Variant>,
    /// Recipes drawn at random, judged on the inner split.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<Search>,
}

/// A study's question and what belongs to it alone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudySettings {
    /// The question.
    pub kind: Study,
    /// Materials that are new.
    #[serde(default = "six")]
    pub new_materials: usize,
    /// Of the five folds of the new materials' sweeps, in how many a whole network is trained from scratch.
    #[serde(default = "one")]
    pub scratch_folds: usize,
}

/// How data sets are split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Stratified folds.
    #[default]
    KFold,
    /// The author's own test sweeps.
    TestFlag,
    /// Fold k tests on the k-th recording block.
    LeaveBlockOut,
}

impl Split {
    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::KFold => "k-fold",
            Self::TestFlag => "test-flag",
            Self::LeaveBlockOut => "leave-block-out",
        }
    }
}

/// What shows how much a data set gives away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Probe {
    /// Nearest neighbour on taxel means.
    Means,
    /// MiniRocket on sweeps whose labels are dealt anew: must score chance.
    Permuted,
}

/// A recipe made from another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// What people call it.
    pub name: String,
    /// Built-in name or file of the recipe it is made from.
    pub base: String,
    /// Settings by their path, such as `training.learning_rate`.
    pub set: Table,
}

/// Recipes drawn at random.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Search {
    /// Built-in name or file of the recipe they are made from.
    #[serde(default)]
    pub base: String,
    /// How many.
    pub trials: usize,
    /// What is drawn, by its path.
    #[serde(default)]
    pub space: BTreeMap<String, Range>,
}

impl Search {
    fn mistake(&self) -> Option<String> {
        if self.base.is_empty() {
            return Some(
                "`search`: this experiment has none; one needs `base`, `trials` and `space`".into(),
            );
        }
        if self.trials == 0 || self.space.is_empty() {
            return Some("`search`: expected at least one trial and one setting to draw".into());
        }
        self.space.iter().find_map(|(path, range)| {
            let fine = match range {
                Range::Uniform { low, high } => low < high && (high - low).is_finite(),
                Range::Logarithmic { low, high } => *low > 0.0 && low < high && high.is_finite(),
                Range::Choice { values } => !values.is_empty(),
            };
            (!fine).then(|| {
                format!(
                    "`search.space.\"{path}\"`: expected something to draw from, found {range:?}"
                )
            })
        })
    }
}

/// What one setting is drawn from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Range {
    /// Any number between two, each equally likely.
    Uniform {
        /// Smallest.
        low: f64,
        /// Largest.
        high: f64,
    },
    /// Any number between two, each order of magnitude equally likely.
    Logarithmic {
        /// Smallest, above 0.
        low: f64,
        /// Largest.
        high: f64,
    },
    /// One of a list.
    Choice {
        /// The list.
        values: Vec<Value>,
    },
}

fn kept() -> Vec<MeanRemoval> {
    vec![MeanRemoval::None]
}

fn k_fold() -> Vec<Split> {
    vec![Split::KFold]
}

fn five() -> usize {
    5
}

fn one() -> usize {
    1
}

fn six() -> usize {
    6
}

fn one_seed() -> u64 {
    1
}

/// A list, or a single value that stands for a list of one.
fn one_or_many<'de, D, T>(deserializer: D) -> Result<Vec<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de>,
{
    let value = Value::deserialize(deserializer)?;
    let values = match value {
        Value::Array(values) => values,
        single => vec![single],
    };
    values
        .into_iter()
        .map(|value| value.try_into().map_err(serde::de::Error::custom))
        .collect()
}

impl ExperimentRecipe {
    /// Experiments that ship with the binary.
    pub fn built_in() -> impl Iterator<Item = Self> {
        BUILT_IN.iter().map(|(name, text)| {
            Self::parse(name, text, &[])
                .unwrap_or_else(|error| panic!("built-in experiments are valid: {error}"))
        })
    }

    /// The TOML of an experiment that ships with the binary.
    ///
    /// # Errors
    /// No such name.
    pub fn built_in_text(name: &str) -> Result<&'static str, ExperimentError> {
        let found = BUILT_IN.iter().find(|(known, _)| *known == name);
        found.map(|(_, text)| *text).ok_or_else(|| unknown(name))
    }

    /// Loads a built-in experiment by name, or a file, with some fields set anew.
    ///
    /// - `settings`: `field=value`, the value in TOML or a bare word
    ///
    /// # Errors
    /// Neither a known name nor a readable file; TOML that does not parse; an unknown field; a setting out of range.
    pub fn load(name_or_path: &str, settings: &[String]) -> Result<Self, ExperimentError> {
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            return Self::parse(name, text, settings);
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            return Err(unknown(name_or_path));
        }
        let text = std::fs::read_to_string(path)
            .map_err(|error| ExperimentError::io(path, "read the experiment", error))?;
        Self::parse(name_or_path, &text, settings)
    }

    /// Parses TOML; `origin` stands in the messages.
    ///
    /// # Errors
    /// As [`ExperimentRecipe::load`].
    pub fn parse(origin: &str, text: &str, settings: &[String]) -> Result<Self, ExperimentError> {
        let refused = |reason: String| ExperimentError::Recipe {
            origin: origin.into(),
            reason: one_line(&reason),
        };
        let mut table: Table = text
            .parse()
            .map_err(|e: toml::de::Error| refused(e.to_string()))?;
        for setting in settings {
            let (path, value) = setting
                .split_once('=')
                .ok_or_else(|| refused(format!("`--set {setting}`: expected FIELD=VALUE")))?;
            let value = parse_value(value.trim())
                .map_err(|e| refused(format!("`--set {setting}`: {e}")))?;
            set(&mut table, current_name(path), value).map_err(refused)?;
        }
        let recipe: Self = Value::Table(table)
            .try_into()
            .map_err(|e: toml::de::Error| refused(e.to_string()))?;
        let drawn = recipe
            .study
            .as_ref()
            .is_some_and(|study| study.kind.draws_materials());
        let unused = settings
            .iter()
            .filter_map(|setting| setting.split_once('='));
        if let Some((path, _)) = unused
            .map(|(path, value)| (current_name(path), value))
            .find(|(path, _)| drawn && ["folds", "repeats"].contains(path))
        {
            return Err(refused(format!(
                "`{path}`: this study draws materials; use `splits`"
            )));
        }
        match recipe.mistake() {
            None => Ok(recipe),
            Some(reason) => Err(refused(reason)),
        }
    }

    fn mistake(&self) -> Option<String> {
        let plain = |name: &str| {
            !name.is_empty()
                && name
                    .chars()
                    .all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c))
        };
        if !plain(&self.name) {
            return Some(format!(
                "`name`: expected letters, digits, `-`, `_`, found `{}`",
                self.name
            ));
        }
        if let Some(variant) = self.variants.iter().find(|variant| !plain(&variant.name)) {
            return Some(format!(
                "`variants.name`: expected letters, digits, `-`, `_`, found `{}`",
                variant.name
            ));
        }
        for (field, empty) in [
            ("data", self.data.is_empty()),
            ("models", self.models.is_empty() && self.search.is_none()),
            ("levels", self.levels.is_empty()),
            ("split", self.split.is_empty()),
        ] {
            if empty {
                return Some(format!("`{field}`: expected at least one, found none"));
            }
        }
        // Data sets are always dealt into five random folds in two repeats; these say how many of them are trained.
        let random = self.split == [Split::KFold];
        for (field, value, most) in [
            ("folds", self.folds, if random { 5 } else { usize::MAX }),
            ("repeats", self.repeats, 2),
        ] {
            if value == 0 || value > most {
                let most = if most == usize::MAX {
                    String::new()
                } else {
                    format!(" to {most}")
                };
                return Some(format!("`{field}`: expected 1{most}, found {value}"));
            }
        }
        if self.epochs == Some(0) {
            return Some("`epochs`: expected at least 1, found 0".into());
        }
        self.study_mistake()
            .or_else(|| self.search.as_ref().and_then(Search::mistake))
    }

    fn study_mistake(&self) -> Option<String> {
        let kind = self.study.as_ref().map(|study| study.kind);
        if kind.is_none() && self.splits.is_some() {
            return Some(
                "`splits`: belong to a study; here `folds` and `repeats` say how many".into(),
            );
        }
        if !kind.is_some_and(Study::counts_sweeps) && !self.shots.is_empty() {
            return Some("`shots`: belong to a study that counts sweeps, such as `nshot`".into());
        }
        if kind != Some(Study::Nshot) && !self.methods.is_empty() {
            return Some("`methods`: belong to a study of kind `nshot`".into());
        }
        let study = self.study.as_ref()?;
        let splits = self.splits.unwrap_or(1);
        if splits == 0 {
            return Some("`splits`: expected at least 1, found 0".into());
        }
        if study.kind == Study::FeatureMaps && splits > 2 {
            return Some("`splits`: 1 is the easy choice of materials, 2 adds the hard one".into());
        }
        if !study.kind.draws_materials() && splits > 10 {
            return Some(format!(
                "`splits`: expected 1 to 10 (two repeats of five folds), found {splits}"
            ));
        }
        if study.new_materials < 2 {
            return Some(format!(
                "`study.new_materials`: expected at least 2, found {}",
                study.new_materials
            ));
        }
        if !(1..=5).contains(&study.scratch_folds) {
            return Some(format!(
                "`study.scratch_folds`: expected 1 to 5, found {}",
                study.scratch_folds
            ));
        }
        if self.shots.contains(&0) || study.kind.learns_from_shots() && self.shots.is_empty() {
            return Some("`shots`: expected one or more numbers above 0".into());
        }
        for (field, used) in [
            ("probes", !self.probes.is_empty()),
            ("groups", self.groups > 0),
            ("search", self.search.is_some()),
            ("split", self.split != [Split::KFold]),
        ] {
            if used {
                return Some(format!("`{field}`: a study has none"));
            }
        }
        None
    }
}

fn unknown(name: &str) -> ExperimentError {
    ExperimentError::Unknown {
        name: name.into(),
        known: BUILT_IN.map(|(name, _)| name).join(", "),
    }
}

/// A message of several lines as one.
fn one_line(text: &str) -> String {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join(", ")
}

/// TOML, or a bare word as a string; what begins like a list, a table or a quoted string must be one.
fn parse_value(text: &str) -> Result<Value, String> {
    match format!("value = {text}").parse::<Table>() {
        Ok(mut table) => Ok(table
            .remove("value")
            .unwrap_or_else(|| Value::String(text.into()))),
        Err(error) if text.starts_with(['[', '{', '"', '\'']) => Err(error.message().into()),
        Err(_) => Ok(Value::String(text.into())),
    }
}

/// The name of a field that `--set` calls by an older one.
fn current_name(path: &str) -> &str {
    match path.trim() {
        "runs" => "repeats",
        path => path,
    }
}

/// Sets a field by its path (`training.learning_rate`), making tables on the way.
pub(crate) fn set(table: &mut Table, path: &str, value: Value) -> Result<(), String> {
    match path.split_once('.') {
        None if path.is_empty() => Err("a setting needs a name before `=`".into()),
        None => {
            table.insert(path.into(), value);
            Ok(())
        }
        Some((first, rest)) => match table
            .entry(first)
            .or_insert_with(|| Value::Table(Table::new()))
        {
            Value::Table(inner) => set(inner, rest, value),
            other => Err(format!("`{first}` is {}, not a table", other.type_str())),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_experiments_parse_and_say_what_to_expect() {
        for (recipe, (name, _)) in ExperimentRecipe::built_in().zip(BUILT_IN) {
            assert_eq!(recipe.name, name);
            assert!(
                recipe.expects.len() > 20 && !recipe.takes.is_empty(),
                "{name}"
            );
        }
    }

    #[test]
    fn any_field_can_be_set() {
        let settings = [
            "data=a b.h5",
            "runs=2",
            "models=[\"minirocket\"]",
            "levels=removed",
            "epochs = 1",
        ]
        .map(String::from);
        let recipe = ExperimentRecipe::load("crossval_baselines", &settings).unwrap();
        assert_eq!(recipe.data, ["a b.h5"]);
        assert_eq!((recipe.repeats, recipe.epochs), (2, Some(1)));
        assert_eq!(recipe.models, ["minirocket"]);
        assert_eq!(recipe.levels, [MeanRemoval::PerSweep]);
    }

    #[test]
    fn mistakes_are_named_in_one_line() {
        for (setting, named) in [
            ("fold=3", "fold"),
            ("folds=0", "folds"),
            ("folds=many", "folds"),
            ("data=[]", "data"),
            ("name.x=1", "name"),
            ("probes=luck", "luck"),
            ("seed", "FIELD=VALUE"),
            ("folds=6", "expected 1 to 5"),
            ("runs=3", "expected 1 to 2"),
            ("models=[\"fast\"", "--set models"),
            ("search.trials=3", "this experiment has none"),
            ("splits=3", "belong to a study"),
            ("shots=1", "belong to a study that counts sweeps"),
            (
                "search={base=\"fast\",trials=1,space={\"training.batch\"={kind=\"choice\",values=[]}}}",
                "training.batch",
            ),
        ] {
            let refused =
                ExperimentRecipe::load("crossval_tactnet2", &[setting.into()]).unwrap_err();
            let message = refused.to_string();
            assert!(message.contains(named), "{setting}: {message}");
            assert!(!message.contains('\n'), "{message}");
        }
        for (study, setting, named) in [
            ("nshot", "folds=3", "use `splits`"),
            ("unknown", "runs=2", "use `splits`"),
            ("sequential", "splits=11", "expected 1 to 10"),
            ("differentiate", "shots=0", "above 0"),
            (
                "feature_maps",
                "shots=1",
                "belong to a study that counts sweeps",
            ),
        ] {
            let refused = ExperimentRecipe::load(study, &[setting.into()]).unwrap_err();
            assert!(refused.to_string().contains(named), "{refused}");
        }
        let unknown = ExperimentRecipe::load("crossvall", &[])
            .unwrap_err()
            .to_string();
        assert!(unknown.contains("crossval_tactnet2"), "{unknown}");
    }
}
