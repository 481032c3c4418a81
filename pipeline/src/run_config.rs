//! What a run decides before its first batch, and what it notes after every epoch.

use serde::{Deserialize, Serialize};
use tactnet_data::Seed;
use tactnet_models::Compute;

use crate::{CalibrationTarget, ClassifierConfig, ModelRecipe};

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
    /// Part of the training sweeps that judges instead of the test sweeps; absent: the test sweeps do.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inner: Option<usize>,
    /// A fifth of the training sweeps is set aside to calibrate with; absent: all are trained on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub promise: Option<CalibrationTarget>,
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
