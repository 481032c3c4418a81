//! Recipes of all kinds of models, by name or from a file.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_data::{TrainSplit, known_names};

use crate::committee::recipe::CommitteeSweeps;
use crate::{
    BaselineRecipe, CommitteeRecipe, LeftOutMember, MeanRemoval, NetworkRecipe, PipelineError,
    PredictionMethod, Teacher,
};

/// Names and TOML of the built-in recipes of baselines.
const BASELINES: [(&str, &str); 12] = [
    ("means", include_str!("../recipes/means.toml")),
    ("first-frame", include_str!("../recipes/first-frame.toml")),
    ("last-frame", include_str!("../recipes/last-frame.toml")),
    ("knn-l", include_str!("../recipes/knn-l.toml")),
    ("knn-h", include_str!("../recipes/knn-h.toml")),
    ("svm-l", include_str!("../recipes/svm-l.toml")),
    ("svm-h", include_str!("../recipes/svm-h.toml")),
    ("lda", include_str!("../recipes/lda.toml")),
    ("svm-spectra", include_str!("../recipes/svm-spectra.toml")),
    ("minirocket", include_str!("../recipes/minirocket.toml")),
    (
        "multirocket-hydra",
        include_str!("../recipes/multirocket-hydra.toml"),
    ),
    ("quant", include_str!("../recipes/quant.toml")),
];

/// Names and TOML of the built-in committees.
const COMMITTEES: [(&str, &str); 1] = [("committee", include_str!("../recipes/committee.toml"))];

/// Recipe of any kind of model.
#[allow(clippy::large_enum_variant)] // few recipes exist at a time
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum ModelRecipe {
    /// A network: TactNet-II or the spectral network.
    #[serde(rename = "tactnet2")]
    Network(NetworkRecipe),
    /// Features and a classical classifier.
    #[serde(rename = "baseline")]
    Baseline(BaselineRecipe),
    /// Several models whose probabilities are averaged.
    #[serde(rename = "committee")]
    Committee(CommitteeRecipe),
}

impl ModelRecipe {
    /// Returns the names of all built-in recipes.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        let others = BASELINES.iter().chain(&COMMITTEES);
        NetworkRecipe::built_in_names().chain(others.map(|(name, _)| *name))
    }

    /// Returns the TOML of a built-in recipe, including its comments.
    ///
    /// # Errors
    /// An unknown name.
    pub fn built_in_text(name: &str) -> Result<&'static str, PipelineError> {
        let others = BASELINES.iter().chain(&COMMITTEES).copied();
        others
            .chain(NetworkRecipe::built_in_texts())
            .find_map(|(known, text)| (known == name).then_some(text))
            .ok_or_else(|| PipelineError::UnknownRecipe {
                name: name.into(),
                known: known_names(name, Self::built_in_names()),
            })
    }

    /// Loads a built-in recipe by name, or a recipe file.
    ///
    /// # Errors
    /// An unknown name that is not a readable file either; invalid TOML; a setting out of range.
    pub fn load(name_or_path: &str) -> Result<Self, PipelineError> {
        let mut others = BASELINES.iter().chain(&COMMITTEES);
        if let Some((name, text)) = others.find(|(name, _)| *name == name_or_path) {
            return Self::parse(name, text);
        }
        if NetworkRecipe::built_in_names().any(|name| name == name_or_path) {
            return NetworkRecipe::load(name_or_path).map(Self::Network);
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            // `tactnet2` is the name of the model, not of a recipe.
            let meant = match name_or_path {
                "tactnet2" => "fast",
                other => other,
            };
            return Err(PipelineError::UnknownRecipe {
                name: name_or_path.into(),
                known: known_names(meant, Self::built_in_names()),
            });
        }
        let text = tactnet_data::read_text(path)
            .map_err(|error| PipelineError::io(path, "read the recipe", error))?;
        Self::parse(name_or_path, &text)
    }

    /// Parses and validates TOML: a baseline if it has the key `features`, a committee if it has `members`, else a network. Error messages name
    /// `origin`.
    ///
    /// # Errors
    /// Invalid TOML; an unknown field; a setting out of range.
    pub fn parse(origin: &str, text: &str) -> Result<Self, PipelineError> {
        let refused = |reason: String| PipelineError::Recipe {
            origin: origin.into(),
            reason,
        };
        let table = text.parse::<toml::Table>().unwrap_or_default();
        if table.contains_key("members") {
            let recipe = CommitteeRecipe::parse(text).map_err(refused)?;
            return Ok(Self::Committee(recipe));
        }
        if !table.contains_key("features") {
            return NetworkRecipe::parse(origin, text).map(Self::Network);
        }
        let recipe: BaselineRecipe = toml::from_str(text)
            .map_err(|error| refused(error.to_string().trim_end().replace('\n', " / ")))?;
        match recipe.validate() {
            Ok(()) => Ok(Self::Baseline(recipe)),
            Err(invalid) => Err(refused(invalid.to_string())),
        }
    }

    /// Returns the recipe from whose probabilities a network learns; `None` if it learns from the labels alone.
    pub fn teacher(&self) -> Option<&ModelRecipe> {
        match self {
            Self::Network(recipe) => recipe.training.teacher.as_ref().map(Teacher::recipe),
            Self::Baseline(_) | Self::Committee(_) => None,
        }
    }

    /// Returns the recipe for training sweeps, and the members of a committee that they do not allow.
    ///
    /// # Errors
    /// Sweeps that allow no member.
    pub(crate) fn for_sweeps(
        &self,
        train: &TrainSplit<'_>,
    ) -> Result<(Self, Vec<LeftOutMember>), PipelineError> {
        match self {
            Self::Network(recipe) => {
                Ok((Self::Network(recipe.for_sweeps(train.len())), Vec::new()))
            }
            Self::Baseline(_) => Ok((self.clone(), Vec::new())),
            Self::Committee(recipe) => {
                let (mut kept, left_out) = recipe.clone().for_sweeps(CommitteeSweeps {
                    shape: train.shape(),
                    rate_hz: train.dataset().sample_rate_hz(),
                    counts: &train.sweeps_per_label(),
                })?;
                for member in &mut kept.members {
                    *member = member.for_sweeps(train)?.0;
                }
                Ok((Self::Committee(kept), left_out))
            }
        }
    }

    /// Returns the recipe's name.
    pub fn name(&self) -> &str {
        match self {
            Self::Network(recipe) => &recipe.name,
            Self::Baseline(recipe) => &recipe.name,
            Self::Committee(recipe) => &recipe.name,
        }
    }

    /// Returns a material that has too few training sweeps for this recipe and the number needed; `None` if all have enough.
    ///
    /// Networks need one sweep of each material, with a teacher two. A baseline that selects settings or calibrates on a part of the sweeps needs two.
    ///
    /// - `counts`: number of training sweeps of each material
    pub fn starved(&self, counts: &[usize]) -> Option<(usize, usize)> {
        match self {
            // The teacher is tested on a part of the sweeps.
            Self::Network(recipe) if recipe.training.teacher.is_some() => counts
                .iter()
                .position(|count| *count < 2)
                .map(|label| (label, 2)),
            Self::Network(_) => None,
            Self::Baseline(recipe) => recipe.starved(counts),
            // Members with too few sweeps are left out.
            Self::Committee(recipe) => {
                let starved = recipe.members.iter().map(|member| member.starved(counts));
                starved
                    .min_by_key(|of| of.map_or(0, |(_, needed)| needed))
                    .flatten()
            }
        }
    }

    /// Checks that weights of the training sweeps, if there are any, can be used.
    ///
    /// # Errors
    /// A model, or the first member of a committee, that cannot use weights.
    pub(crate) fn refuse_weights(&self, train: &TrainSplit<'_>) -> Result<(), PipelineError> {
        if train.weights().is_none() {
            return Ok(());
        }
        match self {
            Self::Network(recipe) => match &recipe.training.teacher {
                Some(teacher) => teacher.recipe().refuse_weights(train),
                None => Ok(()),
            },
            Self::Baseline(recipe) if recipe.takes_weights() => Ok(()),
            Self::Baseline(recipe) => Err(PipelineError::SampleWeights {
                model: recipe.name.clone(),
            }),
            Self::Committee(recipe) => {
                let mut members = recipe.members.iter();
                members.try_for_each(|member| member.refuse_weights(train))
            }
        }
    }

    /// Returns the built-in `models` that can be trained with these numbers of sweeps.
    ///
    /// - `counts`: number of training sweeps of each material
    pub fn not_starved<'a>(
        models: impl IntoIterator<Item = &'a str>,
        counts: &[usize],
    ) -> Vec<&'a str> {
        let can =
            |model: &&str| Self::load(model).is_ok_and(|recipe| recipe.starved(counts).is_none());
        models.into_iter().filter(can).collect()
    }

    /// Returns the default prediction method of a classifier of this recipe.
    pub fn method(&self) -> PredictionMethod {
        match self {
            Self::Network(recipe) => recipe.prediction.method,
            Self::Baseline(_) => PredictionMethod::Plain,
            Self::Committee(recipe) => recipe.method(),
        }
    }

    /// Returns the removal of each taxel's mean over a sweep; of a committee, that of its first member.
    pub fn levels(&self) -> MeanRemoval {
        match self {
            Self::Network(recipe) => recipe.input.levels,
            Self::Baseline(recipe) => recipe.levels,
            Self::Committee(recipe) => recipe.members[0].levels(),
        }
    }

    /// Returns the recipe with another removal of means.
    pub fn with_levels(mut self, levels: MeanRemoval) -> Self {
        match &mut self {
            Self::Network(recipe) => {
                recipe.input.levels = levels;
                let teacher = recipe.training.teacher.take();
                recipe.training.teacher = teacher.map(|it| it.map(|of| of.with_levels(levels)));
            }
            Self::Baseline(recipe) => recipe.levels = levels,
            Self::Committee(recipe) => {
                for member in &mut recipe.members {
                    *member = member.clone().with_levels(levels);
                }
            }
        }
        self
    }

    /// Returns the recipe with another number of epochs of all networks, whatever the number of sweeps.
    pub fn with_epochs(mut self, epochs: usize) -> Self {
        match &mut self {
            Self::Network(recipe) => {
                recipe.training.epochs = epochs;
                recipe.training.least_steps = None;
                let teacher = recipe.training.teacher.take();
                recipe.training.teacher = teacher.map(|it| it.map(|of| of.with_epochs(epochs)));
            }
            Self::Baseline(_) => {}
            Self::Committee(recipe) => {
                for member in &mut recipe.members {
                    *member = member.clone().with_epochs(epochs);
                }
            }
        }
        self
    }

    /// Returns the recipe as TOML.
    ///
    /// # Panics
    /// Never: every recipe can be serialised as TOML.
    pub fn to_toml(&self) -> String {
        match self {
            Self::Network(recipe) => recipe.to_toml(),
            Self::Baseline(recipe) => toml::to_string(recipe)
                .unwrap_or_else(|error| panic!("a recipe is always valid TOML: {error}")),
            Self::Committee(recipe) => recipe.to_toml(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn built_in_recipes_parse_and_carry_their_name() {
        for name in ModelRecipe::built_in_names() {
            let recipe = ModelRecipe::load(name).unwrap();
            assert_eq!(recipe.name(), name);
            let copy = ModelRecipe::built_in_text(name).unwrap();
            assert_eq!(ModelRecipe::parse("copy.toml", copy).unwrap(), recipe);
            assert_eq!(
                ModelRecipe::parse("again", &recipe.to_toml()).unwrap(),
                recipe
            );
        }
    }

    #[test]
    fn a_mistyped_name_is_answered_with_the_one_that_was_meant() {
        let refused = ModelRecipe::load("minirokt").unwrap_err().to_string();
        assert!(
            refused.contains("ship with tactnet: fast, spectra, thesis, robust, distilled, means")
        );
        assert!(refused.ends_with("did you mean `minirocket`?"), "{refused}");
        let refused = ModelRecipe::load("tactnet2").unwrap_err().to_string();
        assert!(refused.ends_with("did you mean `fast`?"), "{refused}");
    }

    #[test]
    fn mistakes_are_named_in_one_line() {
        let named = |(name, _): &&(&str, &str)| *name == "svm-h";
        let svm = BASELINES.iter().find(named).unwrap().1;
        for (from, to, named) in [
            ("kind = \"svm\"", "kind = \"sum\"", "sum"),
            ("features = \"h\"", "features = \"x\"", "x"),
            ("gamma = [", "gamma = [-1.0, ", "classifier.gamma"),
            ("gamma = [", "gama = [", "gama"),
        ] {
            assert!(svm.contains(from), "{from}");
            let refused = ModelRecipe::parse("r.toml", &svm.replace(from, to)).unwrap_err();
            let message = refused.to_string();
            assert!(
                message.contains(named) && message.contains("r.toml"),
                "{message}"
            );
            assert!(!message.contains('\n'), "{message}");
        }
    }
}
