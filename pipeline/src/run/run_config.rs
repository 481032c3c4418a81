//! What a run decides before its first batch, and what it notes after every epoch.

use serde::{Deserialize, Serialize};
use tactnet_data::{Fold, Seed};
use tactnet_models::Compute;

use crate::{CalibrationTarget, ClassifierConfig, ModelRecipe, SplitKind, TrainSpec};

/// `config.json`: all that is decided before the first batch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    /// Version of this layout.
    pub schema_version: u32,
    /// `twin`, or the data set's file.
    pub data: String,
    /// Time steps kept of every sweep, from its beginning; absent: all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<usize>,
    /// Whose labels the sweeps have.
    #[serde(default, skip_serializing_if = "LabelOrder::is_true")]
    pub label_order: LabelOrder,
    /// Part of the training sweeps that is tested on instead of the test sweeps; absent: the test sweeps are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inner: Option<usize>,
    /// A fifth of the training sweeps is set aside to calibrate with; absent: all are trained on.
    #[serde(
        rename = "target",
        alias = "promise",
        default,
        skip_serializing_if = "Option::is_none"
    )]
    pub calibration_target: Option<CalibrationTarget>,
    /// Built-in name or file of the recipe, as it was asked for.
    pub recipe_source: String,
    /// SHA-256 of the data set's content.
    pub data_sha256: String,
    /// Names every random choice.
    pub seed: Seed,
    /// Where tensors live.
    pub compute: Compute,
    /// How the classifier comes about.
    pub recipe: ModelRecipe,
    /// Everything about the classifier but its weights.
    pub classifier: ClassifierConfig,
}

impl RunConfig {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 2;

    /// The spec that leads to this run again, with everything named that it left to recipe and data set.
    ///
    /// - `fold`: what the run trains and tests on
    pub fn spec(&self, fold: &Fold<'_>) -> TrainSpec {
        TrainSpec {
            data: self.data.clone(),
            recipe: self.recipe_source.clone(),
            mean_removal: Some(self.recipe.levels()),
            steps: self.steps,
            label_order: self.label_order,
            split: Some(SplitKind::of(fold.scheme())),
            fold: Some(fold.fold()),
            repeat: fold.repeat(),
            inner: self.inner,
            calibration: self.calibration_target,
            seed: self.seed,
            epochs: match &self.recipe {
                ModelRecipe::TactNet2(recipe) => Some(recipe.training.epochs),
                ModelRecipe::Baseline(_) => None,
            },
            device: self.compute,
        }
    }
}

/// Whose labels the sweeps have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LabelOrder {
    /// Their own.
    #[default]
    True,
    /// Dealt anew at random, to see that nothing can be learnt from them.
    Permuted,
}

impl LabelOrder {
    fn is_true(&self) -> bool {
        *self == Self::True
    }
}

/// One line of `metrics.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochMetrics {
    /// Epoch, counted from 1.
    pub epoch: usize,
    /// Mean objective over the training sweeps, nats.
    pub train_loss: f64,
    /// Share of training sweeps recognised, with dropout on.
    pub train_accuracy: f64,
    /// Learning rate used.
    pub learning_rate: f64,
    /// Time spent in its training steps, seconds.
    pub seconds: f64,
}
