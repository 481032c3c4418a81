//! Questions whose unit of work is more than one training: few sweeps of new materials, same or different, unknown, when to stop.
//!
//! A task answers the question once, for one split of the data, and leaves its measurements in `result.json`; the summary takes their
//! means over tasks.

mod differentiate;
mod enrolment;
mod feature_maps;
mod hard_pairs;
mod knowledge;
mod pairs;
mod roc;
mod sequential;
mod transfer;
mod transfer_method;
mod tuning;
mod unknown;

use std::time::Instant;

use burn::tensor::Device;
use rand::Rng;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use tactnet_data::{DataOrigin, Dataset, Seed};
use tactnet_pipeline::{BatchReport, PipelineError, Provenance, Recipe};

use crate::ExperimentError;
pub use feature_maps::FeatureMap;
pub use transfer_method::TransferMethod;

/// A question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Study {
    /// n-shot transfer to new materials (thesis, section 4.6).
    Nshot,
    /// Are two sweeps of one material? (Thesis, sections 4.4.3 and 4.4.4.)
    Differentiate,
    /// Is it a material that was never seen?
    Unknown,
    /// How many sweeps until it is sure?
    Sequential,
    /// A material more for a trained classifier.
    Enrolment,
    /// Easy and hard materials in a plane.
    FeatureMaps,
}

impl Study {
    /// Its name in recipes and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Nshot => "nshot",
            Self::Differentiate => "differentiate",
            Self::Unknown => "unknown",
            Self::Sequential => "sequential",
            Self::Enrolment => "enrolment",
            Self::FeatureMaps => "feature-maps",
        }
    }

    /// Whether every task draws new materials.
    pub fn draws_materials(self) -> bool {
        matches!(
            self,
            Self::Nshot | Self::Unknown | Self::Enrolment | Self::FeatureMaps
        )
    }

    /// Whether it learns new materials from a number of sweeps.
    pub fn learns_from_shots(self) -> bool {
        matches!(self, Self::Nshot | Self::Enrolment)
    }

    /// Whether numbers of sweeps belong to its question: to learn from, or behind one decision.
    pub fn counts_sweeps(self) -> bool {
        self != Self::FeatureMaps
    }

    /// Test sweeps over training sweeps, where tasks share training sweeps; 0 where every task draws its own split of the materials.
    pub(crate) fn test_share(self) -> f64 {
        match self {
            Self::Nshot | Self::Unknown | Self::Enrolment | Self::FeatureMaps => 0.0,
            Self::Differentiate | Self::Sequential => 0.25,
        }
    }
}

/// One task of a study: everything that decides its answer but the data.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyTask {
    /// The question.
    pub study: Study,
    /// Which split, counted from 0: of the materials, or (5 per run) of the sweeps.
    pub number: usize,
    /// Names every random choice.
    pub seed: u64,
    /// Sweeps of every new material that are learnt from, or behind one decision.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shots: Vec<usize>,
    /// Methods of transfer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub methods: Vec<TransferMethod>,
    /// Materials that are new.
    pub new_materials: usize,
    /// Inner folds in which a network is trained from scratch, 1 to 5.
    pub scratch_folds: usize,
}

/// One number that a task measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    /// What was measured: `accuracy`, `auroc`, …
    pub measure: String,
    /// By which method.
    pub method: String,
    /// Under which circumstances, if there are several: `hard pairs`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub setting: String,
    /// Sweeps of every new material that were learnt from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shots: Option<usize>,
    /// Sweeps behind one decision.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweeps: Option<usize>,
    /// The number; shares are 0 to 1.
    pub value: f64,
    /// Decisions behind it.
    pub decisions: usize,
}

impl Measurement {
    /// A measurement without shots, sweeps or setting.
    pub(crate) fn new(measure: &str, method: &str, value: f64, decisions: usize) -> Self {
        Self {
            measure: measure.into(),
            method: method.into(),
            setting: String::new(),
            shots: None,
            sweeps: None,
            value,
            decisions,
        }
    }

    pub(crate) fn setting(self, setting: impl Into<String>) -> Self {
        Self {
            setting: setting.into(),
            ..self
        }
    }

    pub(crate) fn shots(self, shots: usize) -> Self {
        Self {
            shots: Some(shots),
            ..self
        }
    }

    pub(crate) fn sweeps(self, sweeps: usize) -> Self {
        Self {
            sweeps: Some(sweeps),
            ..self
        }
    }
}

/// `result.json` of a study's task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyResult {
    /// Version of this layout, [`StudyResult::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// What was asked.
    pub task: StudyTask,
    /// Name of the data set.
    pub data: String,
    /// Where its sweeps come from.
    #[serde(default)]
    pub origin: DataOrigin,
    /// SHA-256 of its content.
    pub data_sha256: String,
    /// Its materials in label order.
    pub materials: Vec<String>,
    /// `kept` or `removed`.
    pub levels: String,
    /// Name of the networks' recipe.
    pub recipe: String,
    /// SHA-256 of the recipe as TOML.
    pub recipe_sha256: String,
    /// The split, for people.
    pub split: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// What was chosen on the way, by name.
    pub chosen: std::collections::BTreeMap<String, f64>,
    /// What was measured.
    pub measurements: Vec<Measurement>,
    /// Sweeps in a plane, where the study draws them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<FeatureMap>,
    /// Time of the task, seconds.
    pub seconds: f64,
    /// Largest resident memory of the process, MiB.
    pub peak_rss_mib: Option<f64>,
    /// Program and machine.
    pub provenance: Provenance,
}

impl StudyResult {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 1;
}

impl StudyTask {
    /// Sweeps behind one decision: those that were asked for, or else the study's own.
    fn sweeps_or<'a>(&'a self, own: &'a [usize]) -> &'a [usize] {
        if self.shots.is_empty() {
            own
        } else {
            &self.shots
        }
    }
}

/// What a study needs besides its task.
pub(crate) struct StudyContext<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) recipe: &'a Recipe,
    pub(crate) device: &'a Device,
    pub(crate) seed: Seed,
    go_on: &'a dyn Fn(&str, Option<&BatchReport>) -> bool,
}

/// Why a task ended without an answer.
pub(crate) enum Cancelled {
    /// Somebody asked to stop.
    Stopped,
    /// It cannot be done.
    Failed(PipelineError),
}

impl<E: Into<PipelineError>> From<E> for Cancelled {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

impl StudyContext<'_> {
    /// Says what comes next.
    ///
    /// # Errors
    /// Somebody asked to stop.
    pub(crate) fn say(&self, what: &str) -> Result<(), Cancelled> {
        if (self.go_on)(what, None) {
            Ok(())
        } else {
            Err(Cancelled::Stopped)
        }
    }

    /// A seed of its own for everything named `name`.
    pub(crate) fn seed_for(&self, name: &str, number: usize) -> Seed {
        Seed(self.seed.rng((name, number)).next_u64())
    }
}

/// What a study found, before it is put into a file.
pub(crate) struct Answer {
    pub(crate) measurements: Vec<Measurement>,
    pub(crate) split: String,
    /// What `split_sha256` is taken of.
    pub(crate) split_content: String,
    pub(crate) chosen: std::collections::BTreeMap<String, f64>,
}

/// Answers a study's question for one split. `None` when `go_on` said no.
///
/// - `go_on`: told what is being done, with every batch of a training; false stops
///
/// # Errors
/// A data set that is too small for the question; a setting out of range.
pub fn run_study(
    task: &StudyTask,
    dataset: &Dataset,
    recipe: &Recipe,
    device: &Device,
    provenance: Provenance,
    go_on: impl Fn(&str, Option<&BatchReport>) -> bool,
) -> Result<Option<StudyResult>, ExperimentError> {
    let begun = Instant::now();
    let context = StudyContext {
        dataset,
        recipe,
        device,
        seed: Seed(task.seed),
        go_on: &go_on,
    };
    let mut maps = Vec::new();
    let answer = match task.study {
        Study::FeatureMaps => feature_maps::feature_maps(task, &context).map(|(answer, drawn)| {
            maps = drawn;
            answer
        }),
        Study::Nshot => transfer::transfer(task, &context),
        Study::Differentiate => differentiate::differentiate(task, &context),
        Study::Unknown => unknown::unknown(task, &context),
        Study::Sequential => sequential::sequential(task, &context),
        Study::Enrolment => enrolment::enrolment(task, &context),
    };
    let answer = match answer {
        Ok(answer) => answer,
        Err(Cancelled::Stopped) => return Ok(None),
        Err(Cancelled::Failed(error)) => return Err(error.into()),
    };
    let hex = |text: &str| -> String {
        let digest = Sha256::digest(text);
        digest.iter().map(|byte| format!("{byte:02x}")).collect()
    };
    Ok(Some(StudyResult {
        schema_version: StudyResult::SCHEMA_VERSION,
        task: task.clone(),
        data: dataset.name().into(),
        origin: dataset.origin(),
        data_sha256: dataset.sha256().into(),
        materials: dataset.labels().names().map(String::from).collect(),
        levels: recipe.input.levels.name().into(),
        recipe: recipe.name.clone(),
        recipe_sha256: hex(&recipe.to_toml()),
        split: answer.split,
        split_sha256: hex(&answer.split_content),
        chosen: answer.chosen,
        measurements: answer.measurements,
        maps,
        seconds: begun.elapsed().as_secs_f64(),
        peak_rss_mib: tactnet_pipeline::peak_rss_mib(),
        provenance,
    }))
}
