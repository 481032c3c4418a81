//! Recipes of networks: TOML files with all settings of training and prediction.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_data::known_names;
use tactnet_models::Architecture;

use crate::error::InvalidSetting;
use crate::{Augmentation, MeanRemoval, ModelRecipe, PipelineError, Scaling};

/// Names and TOML of the built-in recipes.
const BUILT_IN: [(&str, &str); 5] = [
    ("fast", include_str!("../recipes/fast.toml")),
    ("spectra", include_str!("../recipes/spectra.toml")),
    ("thesis", include_str!("../recipes/thesis.toml")),
    ("robust", include_str!("../recipes/robust.toml")),
    ("distilled", include_str!("../recipes/distilled.toml")),
];

/// All settings from which a network is trained and with which it predicts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NetworkRecipe {
    /// Name of the recipe.
    pub name: String,
    /// Layers of the network.
    #[serde(default)]
    pub network: Architecture,
    /// Preprocessing of the digits.
    #[serde(default)]
    pub input: Input,
    /// Settings of the optimisation.
    pub training: TrainingSettings,
    /// Settings of the prediction.
    #[serde(default)]
    pub prediction: Prediction,
}

/// Preprocessing of the digits before they enter the network.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Input {
    /// See [`Scaling`].
    pub scaling: Scaling,
    /// Removal of each taxel's mean over a sweep.
    #[serde(skip_serializing_if = "MeanRemoval::is_none")]
    pub levels: MeanRemoval,
}

/// Settings of the optimisation (Adam with beta 0.9 and 0.999, epsilon 1e-8).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrainingSettings {
    /// Passes over the training sweeps.
    pub epochs: usize,
    /// Minimum number of optimiser steps; few sweeps get more epochs to reach it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub least_steps: Option<usize>,
    /// Maximum number of sweeps in a batch. The batches of an epoch differ by at most one sweep.
    pub batch: usize,
    /// Learning rate of the first epoch; with `one_cycle`, the highest rate.
    pub learning_rate: f64,
    /// Epochs after which the learning rate falls.
    #[serde(default)]
    pub learning_rate_drops: Vec<LearningRateDrop>,
    /// One-cycle schedule, which replaces the drops.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub one_cycle: Option<OneCycle>,
    /// L2 penalty. `l2 * parameter` is added to each penalised parameter's gradient before Adam.
    #[serde(default)]
    pub l2: f64,
    /// Parameters with an L2 penalty.
    #[serde(default, skip_serializing_if = "is_default")]
    pub l2_on: PenalizedParameters,
    /// Random changes of the training sweeps, drawn anew in every epoch.
    #[serde(default, skip_serializing_if = "Augmentation::is_none")]
    pub augmentation: Augmentation,
    /// Loss.
    pub method: TrainingMethod,
    /// Model whose out-of-fold probabilities the network learns from, besides the labels; `None`: the labels alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub teacher: Option<Teacher>,
}

/// Recipe of a network's teacher. In TOML it is the name of a built-in recipe or a whole recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "TeacherText", into = "ModelRecipe")]
pub struct Teacher(Box<ModelRecipe>);

#[derive(Deserialize)]
#[serde(untagged)]
enum TeacherText {
    Named(String),
    Whole(Box<ModelRecipe>),
}

impl TryFrom<TeacherText> for Teacher {
    type Error = String;

    fn try_from(text: TeacherText) -> Result<Self, String> {
        let recipe = match text {
            TeacherText::Named(name) => {
                Box::new(ModelRecipe::load(&name).map_err(|error| error.to_string())?)
            }
            TeacherText::Whole(recipe) => recipe,
        };
        let members = match &*recipe {
            ModelRecipe::Committee(committee) => committee.members.as_slice(),
            other => std::slice::from_ref(other),
        };
        match members.iter().find(|member| member.teacher().is_some()) {
            None => Ok(Self(recipe)),
            Some(member) => Err(format!(
                "teacher: expected recipes without a teacher, found `{}`",
                member.name()
            )),
        }
    }
}

impl From<Teacher> for ModelRecipe {
    fn from(teacher: Teacher) -> Self {
        *teacher.0
    }
}

impl Teacher {
    /// Returns the recipe.
    pub fn recipe(&self) -> &ModelRecipe {
        &self.0
    }

    /// Returns the teacher with another recipe of the same model.
    pub(crate) fn map(self, change: impl FnOnce(ModelRecipe) -> ModelRecipe) -> Self {
        Self(Box::new(change(*self.0)))
    }
}

/// One-cycle learning rate, updated after each batch (Smith & Topin, 2019; constants of PyTorch's `OneCycleLR`).
///
/// The rate rises along half a cosine from 1/25 of the highest rate to the highest rate during `warm_up`, then falls along half a cosine to
/// 1/10000 of the initial rate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OneCycle {
    /// Share of the training during which the rate rises, in `(0, 1)`.
    pub warm_up: f64,
}

impl OneCycle {
    /// Returns the factor on the highest rate at `progress`, 0 to 1.
    fn factor(self, progress: f64) -> f64 {
        let first = 1.0 / 25.0;
        let half_cosine = |from: f64, to: f64, share: f64| {
            to + (from - to) * 0.5 * (1.0 + (std::f64::consts::PI * share).cos())
        };
        if progress < self.warm_up {
            half_cosine(first, 1.0, progress / self.warm_up)
        } else {
            let share = (progress - self.warm_up) / (1.0 - self.warm_up);
            half_cosine(1.0, first * 1e-4, share)
        }
    }
}

/// Drop of the learning rate by a factor.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LearningRateDrop {
    /// Number of epochs before the drop.
    pub after_epoch: usize,
    /// Factor on the learning rate, above 0.
    pub factor: f64,
}

/// Loss that training minimises.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum TrainingMethod {
    /// Cross entropy.
    Base,
    /// `alpha E(x) + (1 - alpha) E(x + epsilon sign(dE/dx))` (thesis, section 4.4.1; Goodfellow et al., 2014).
    Adversarial {
        /// Weight of the clean loss, 0 to 1.
        alpha: f64,
        /// Size of the perturbation in digits of the sensor, whatever the scaling.
        epsilon: f64,
        /// See [`AdversarialStatistics`].
        #[serde(default, skip_serializing_if = "is_default")]
        statistics: AdversarialStatistics,
        /// See [`AdversarialMask`].
        #[serde(default, skip_serializing_if = "is_default")]
        mask: AdversarialMask,
        /// See [`AttackedLabel`].
        #[serde(default, skip_serializing_if = "is_default")]
        attack: AttackedLabel,
    },
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Parameters that an L2 penalty applies to. The papers do not specify them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PenalizedParameters {
    /// All, as PyTorch's optimisers do.
    #[default]
    All,
    /// Weights of convolutions and dense layers, without biases and batch normalisation.
    Weights,
}

/// Passes that update the running statistics of batch normalisation. The papers do not specify them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdversarialStatistics {
    /// The clean pass only, since prediction sees clean sweeps.
    #[default]
    Clean,
    /// The clean pass, then the adversarial pass, as if both ran through one layer.
    Both,
}

/// Dropout mask of the adversarial pass. The papers do not specify it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AdversarialMask {
    /// A mask drawn separately from the clean pass.
    #[default]
    Own,
    /// The mask of the clean pass.
    Shared,
}

/// Label whose loss the perturbation increases.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AttackedLabel {
    /// The sweep's own material, as published. The network may learn to read the label from the perturbation (Kurakin et al., 2017).
    #[default]
    True,
    /// The material with the highest predicted probability; costs another forward and backward pass.
    Predicted,
}

/// Settings of the prediction.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prediction {
    /// See [`PredictionMethod`].
    pub method: PredictionMethod,
}

/// Method that computes probabilities. The order of the variants is that of their names in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum PredictionMethod {
    /// Mean of the softmax over `mc_samples` passes with dropout kept on and batch norm frozen (Gal & Ghahramani, 2016).
    McDropout {
        /// Number of passes M.
        #[serde(alias = "runs")]
        mc_samples: usize,
    },
    /// One pass without dropout.
    #[default]
    Plain,
}

impl PredictionMethod {
    /// Returns the name in results: `plain` or `mc_dropout`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::McDropout { .. } => "mc_dropout",
        }
    }

    /// Returns the name for readers.
    pub fn title(self) -> &'static str {
        match self {
            Self::Plain => "without dropout",
            Self::McDropout { .. } => "MC dropout",
        }
    }

    /// Returns the number of Monte Carlo passes, or `otherwise` for a plain prediction.
    pub fn mc_samples_or(self, otherwise: usize) -> usize {
        match self {
            Self::Plain => otherwise,
            Self::McDropout { mc_samples } => mc_samples,
        }
    }
}

impl NetworkRecipe {
    /// Returns the names of the built-in recipes.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|(name, _)| *name)
    }

    /// Returns names and TOML of the built-in recipes.
    pub(crate) fn built_in_texts() -> impl Iterator<Item = (&'static str, &'static str)> {
        BUILT_IN.iter().copied()
    }

    /// Loads a built-in recipe by name, or a recipe file.
    ///
    /// # Errors
    /// An unknown name that is not a readable file either; invalid TOML; a setting out of range.
    pub fn load(name_or_path: &str) -> Result<Self, PipelineError> {
        if let Some((name, text)) = BUILT_IN.iter().find(|(name, _)| *name == name_or_path) {
            return Self::parse(name, text);
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            return Err(PipelineError::UnknownRecipe {
                name: name_or_path.into(),
                known: known_names(name_or_path, Self::built_in_names()),
            });
        }
        let text = tactnet_data::read_text(path)
            .map_err(|error| PipelineError::io(path, "read the recipe", error))?;
        Self::parse(name_or_path, &text)
    }

    /// Parses and validates TOML; error messages name `origin`.
    ///
    /// # Errors
    /// Invalid TOML; an unknown field; a setting out of range.
    pub fn parse(origin: &str, text: &str) -> Result<Self, PipelineError> {
        let recipe: Self = toml::from_str(text).map_err(|error| PipelineError::Recipe {
            origin: origin.into(),
            reason: error.to_string().trim_end().replace('\n', " / "),
        })?;
        match recipe.validate() {
            Ok(()) => Ok(recipe),
            Err(invalid) => Err(PipelineError::Recipe {
                origin: origin.into(),
                reason: invalid.to_string(),
            }),
        }
    }

    /// Returns the recipe as TOML.
    ///
    /// # Panics
    /// Never: every recipe can be serialised as TOML.
    pub fn to_toml(&self) -> String {
        toml::to_string(self)
            .unwrap_or_else(|error| panic!("a recipe is always valid TOML: {error}"))
    }

    /// Returns a copy for `sweeps` training sweeps, with enough epochs for the minimum number of steps.
    #[must_use]
    pub fn for_sweeps(&self, sweeps: usize) -> Self {
        let mut recipe = self.clone();
        let training = &mut recipe.training;
        if let Some(steps) = training.least_steps.take() {
            let batches = sweeps.div_ceil(training.batch).max(1);
            training.epochs = training.epochs.max(steps.div_ceil(batches));
        }
        recipe
    }

    /// Returns the learning rate of batch `batch` of `batches` in `epoch`, both counted from 0.
    pub fn learning_rate(&self, epoch: usize, batch: usize, batches: usize) -> f64 {
        let training = &self.training;
        if let Some(cycle) = training.one_cycle {
            let done = (epoch * batches + batch) as f64;
            let last = (training.epochs * batches).saturating_sub(1).max(1) as f64;
            return training.learning_rate * cycle.factor(done / last);
        }
        training
            .learning_rate_drops
            .iter()
            .filter(|drop| epoch >= drop.after_epoch)
            .fold(training.learning_rate, |rate, drop| rate * drop.factor)
    }

    fn validate(&self) -> Result<(), InvalidSetting> {
        if self.name.trim().is_empty() {
            return wrong("name", "a name", "an empty one".into());
        }
        self.training.validate()?;
        if let PredictionMethod::McDropout { mc_samples: 0 } = self.prediction.method {
            return wrong("prediction.method.mc_samples", "at least 1", "0".into());
        }
        Ok(())
    }
}

fn wrong(
    setting: &'static str,
    expected: &'static str,
    found: String,
) -> Result<(), InvalidSetting> {
    Err(InvalidSetting {
        setting,
        expected,
        found,
    })
}

impl TrainingSettings {
    fn validate(&self) -> Result<(), InvalidSetting> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if self.epochs == 0 {
            return wrong("training.epochs", "at least 1", "0".into());
        }
        if self.batch < 2 {
            let expected = "at least 2, since batch norm needs more than one sweep";
            return wrong("training.batch", expected, self.batch.to_string());
        }
        if !positive(self.learning_rate) {
            return wrong(
                "training.learning_rate",
                "a positive number",
                self.learning_rate.to_string(),
            );
        }
        if !(self.l2.is_finite() && self.l2 >= 0.0) {
            return wrong("training.l2", "a number of at least 0", self.l2.to_string());
        }
        if let Some(drop) = self
            .learning_rate_drops
            .iter()
            .find(|d| !positive(d.factor))
        {
            return wrong(
                "training.learning_rate_drops",
                "positive factors",
                drop.factor.to_string(),
            );
        }
        if let Some(OneCycle { warm_up }) = self.one_cycle {
            if !(warm_up > 0.0 && warm_up < 1.0) {
                let expected = "a share above 0 and below 1";
                return wrong("training.one_cycle.warm_up", expected, warm_up.to_string());
            }
            if !self.learning_rate_drops.is_empty() {
                let expected = "none beside `one_cycle`";
                let found = format!("{} drops", self.learning_rate_drops.len());
                return wrong("training.learning_rate_drops", expected, found);
            }
        }
        self.augmentation.validate()?;
        if let TrainingMethod::Adversarial { alpha, epsilon, .. } = self.method {
            if !(0.0..=1.0).contains(&alpha) {
                return wrong("training.method.alpha", "0 to 1", alpha.to_string());
            }
            if !(epsilon.is_finite() && epsilon >= 0.0) {
                return wrong("training.method.epsilon", "at least 0", epsilon.to_string());
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
