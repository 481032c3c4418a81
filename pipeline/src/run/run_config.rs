//! Configuration of a run, and the metrics of its epochs.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tactnet_data::twin::TwinVersion;
use tactnet_data::{Fold, Scheme, Seed};
use tactnet_models::Compute;

use crate::{
    CalibrationTarget, ClassifierConfig, ModelRecipe, PipelineError, PipelineRemedy, SplitKind,
    TrainSpec,
};

/// `config.json`: everything that is fixed before the first batch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunConfig {
    /// Version of this layout.
    pub schema_version: u32,
    /// Settings of the training as requested.
    pub spec: TrainSpec,
    /// SHA-256 of the data set's content.
    pub data_sha256: String,
    /// Recipe of the classifier.
    pub recipe: ModelRecipe,
    /// Configuration of the classifier: everything except its weights.
    pub classifier: ClassifierConfig,
}

impl RunConfig {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 4;

    /// Reads a `config.json` of this version, of version 3 or of version 2. In those two, `twin` means version 1 of the twin.
    ///
    /// # Errors
    /// Another version; invalid JSON.
    pub fn from_json(text: &str) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Versioned {
            schema_version: u32,
        }
        let refused = |error: serde_json::Error| error.to_string();
        let Versioned { schema_version } = serde_json::from_str(text).map_err(refused)?;
        match schema_version {
            Self::SCHEMA_VERSION => serde_json::from_str(text).map_err(refused),
            3 => serde_json::from_str::<Self>(text)
                .map(Self::of_first_twin)
                .map_err(refused),
            2 => serde_json::from_str::<ConfigOfVersion2>(text)
                .map(|old| Self::from(old).of_first_twin())
                .map_err(refused),
            other => Err(format!(
                "expected schema version {}, 3 or 2, found {other}",
                Self::SCHEMA_VERSION
            )),
        }
    }

    /// Returns the configuration of a run from the time when there was only one twin.
    fn of_first_twin(mut self) -> Self {
        self.schema_version = Self::SCHEMA_VERSION;
        if self.spec.data == TwinVersion::Two.name() {
            self.spec.data = TwinVersion::One.name().into();
        }
        self
    }

    /// Succeeds if the run's model is a network.
    ///
    /// - `run`: path of the run directory
    /// - `what`: action that only networks support, as a verb phrase
    ///
    /// # Errors
    /// A baseline or committee.
    pub fn require_network(&self, run: &Path, what: &str) -> Result<(), PipelineError> {
        let (kind, remedy) = match &self.recipe {
            ModelRecipe::Network(_) => return Ok(()),
            ModelRecipe::Baseline(_) => ("baseline", PipelineRemedy::TrainNetwork),
            ModelRecipe::Committee(_) => {
                let run = run.to_path_buf();
                ("committee", PipelineRemedy::Distill { run })
            }
        };
        let name = self.recipe.name();
        let reason = format!("it is a {kind} ({name}), and only networks can {what}");
        Err(PipelineError::run(run, reason).with_remedy(remedy))
    }

    /// Succeeds if the run's model is a network or a committee.
    ///
    /// - `run`: path of the run directory
    /// - `what`: action that baselines do not support, as a verb phrase
    ///
    /// # Errors
    /// A baseline.
    pub fn require_network_or_committee(
        &self,
        run: &Path,
        what: &str,
    ) -> Result<(), PipelineError> {
        match &self.recipe {
            ModelRecipe::Network(_) | ModelRecipe::Committee(_) => Ok(()),
            ModelRecipe::Baseline(recipe) => {
                let name = &recipe.name;
                let reason = format!(
                    "it is a baseline ({name}), and only networks and committees can {what}"
                );
                Err(PipelineError::run(run, reason).with_remedy(PipelineRemedy::TrainNetwork))
            }
        }
    }

    /// Returns settings that reproduce this run, with every value that the recipe or data set supplied.
    ///
    /// - `fold`: training and test sweeps of the run
    pub fn named_spec(&self, fold: &Fold<'_>) -> TrainSpec {
        TrainSpec {
            mean_removal: Some(self.recipe.levels()),
            split: Some(SplitKind::of(fold.scheme())),
            folds: match fold.scheme() {
                Scheme::StratifiedKFold { folds, .. } if fold.scheme() != Scheme::default() => {
                    Some(folds)
                }
                _ => None,
            },
            fold: Some(fold.fold()),
            repeat: fold.repeat(),
            epochs: match &self.recipe {
                ModelRecipe::Network(recipe) => Some(recipe.training.epochs),
                ModelRecipe::Baseline(_) => None,
                ModelRecipe::Committee(_) => self.spec.epochs,
            },
            ..self.spec.clone()
        }
    }
}

/// `config.json` of version 2, in which the settings are at the top level and `split.json` alone holds the split.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConfigOfVersion2 {
    #[serde(rename = "schema_version")]
    _schema_version: u32,
    data: String,
    #[serde(default)]
    steps: Option<usize>,
    #[serde(default)]
    label_order: LabelOrder,
    #[serde(default)]
    inner: Option<usize>,
    #[serde(rename = "target", alias = "promise", default)]
    calibration: Option<CalibrationTarget>,
    recipe_source: String,
    data_sha256: String,
    seed: Seed,
    compute: Compute,
    recipe: ModelRecipe,
    classifier: ClassifierConfig,
}

impl From<ConfigOfVersion2> for RunConfig {
    fn from(old: ConfigOfVersion2) -> Self {
        Self {
            schema_version: Self::SCHEMA_VERSION,
            spec: TrainSpec {
                data: old.data,
                recipe: old.recipe_source,
                steps: old.steps,
                label_order: old.label_order,
                inner: old.inner,
                calibration: old.calibration,
                seed: old.seed,
                device: old.compute,
                ..TrainSpec::default()
            },
            data_sha256: old.data_sha256,
            recipe: old.recipe,
            classifier: old.classifier,
        }
    }
}

/// Order of the labels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LabelOrder {
    /// Each sweep has its own label.
    #[default]
    True,
    /// Labels are permuted at random, as a control: nothing can be learnt from them.
    Permuted,
}

/// One line of `metrics.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochMetrics {
    /// Epoch, counted from 1.
    pub epoch: usize,
    /// Mean training loss, in nats.
    pub train_loss: f64,
    /// Accuracy on the training sweeps, with dropout.
    pub train_accuracy: f64,
    /// Accuracy on adversarial training sweeps; absent without adversarial training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adversarial_accuracy: Option<f64>,
    /// Accuracy on the test sweeps under training conditions (batch statistics, dropout); absent unless test sweeps are watched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub test_accuracy: Option<f64>,
    /// Accuracy on adversarial test sweeps; absent unless test sweeps are watched.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub adversarial_test_accuracy: Option<f64>,
    /// Learning rate of the epoch's last batch.
    pub learning_rate: f64,
    /// Time spent in the training steps of the epoch, in seconds.
    pub seconds: f64,
}
