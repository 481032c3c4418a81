//! The result of a question's task, and its file.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

use serde::{Deserialize, Serialize};
use tactnet_data::{DataOrigin, Dataset, sha256_hex};
use tactnet_models::Compute;
use tactnet_pipeline::{MeanRemoval, ModelRecipe, Provenance, write_whole};

use crate::answer::FeatureMap;
use crate::context::{Cancelled, OnProgress, StudyContext};
use crate::networks::FinishedNetworks;
use crate::{ExperimentError, Measurement, QuestionTask};

/// Content of `result.json` of a question's task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuestionResult {
    /// Version of this layout, [`QuestionResult::SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The question and the part of the data.
    pub task: QuestionTask,
    /// Name of the data set.
    pub data: String,
    /// Origin of the sweeps.
    pub origin: DataOrigin,
    /// SHA-256 of the data set's content.
    pub data_sha256: String,
    /// Assumed sample rate, in Hz; absent if the data set states its rate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_rate_hz: Option<f64>,
    /// Materials in label order.
    pub materials: Vec<String>,
    /// Time steps of a sweep.
    pub steps: usize,
    /// Treatment of the mean of each taxel.
    pub levels: MeanRemoval,
    /// Device of the computation.
    pub device: Compute,
    /// Name of the networks' recipe.
    pub recipe: String,
    /// SHA-256 of the recipe as TOML.
    pub recipe_sha256: String,
    /// Description of the split.
    pub split: String,
    /// SHA-256 of the split.
    pub split_sha256: String,
    /// Settings that the task selected, by name.
    pub chosen: BTreeMap<String, f64>,
    /// The measurements.
    pub measurements: Vec<Measurement>,
    /// Two-dimensional embeddings of sweeps, if the question computes them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<FeatureMap>,
    /// Duration of the session that finished the task, in seconds.
    pub seconds: f64,
    /// Peak resident memory of the process, in MiB.
    pub peak_rss_mib: Option<f64>,
    /// Program and machine.
    pub provenance: Provenance,
}

impl QuestionResult {
    /// Version written by this program.
    pub const SCHEMA_VERSION: u32 = 2;
}

/// Answers a question for one part of a data set and writes `result.json`.
///
/// Returns `None` if `on_progress` returned false; trained networks are then kept for the next call.
///
/// - `dataset`: data set, cut to the task's number of steps
/// - `model`: recipe of the networks or of the baseline, with the task's levels and epochs
/// - `folder`: folder of the task
/// - `on_progress`: receives the current step and each training batch, and returns false to stop
///
/// # Errors
/// A baseline, if the question is about networks only; a device that this build does not support; a data set that is too small for the question; a file that cannot be
/// written.
pub fn answer_question(
    task: &QuestionTask,
    dataset: &Dataset,
    model: &ModelRecipe,
    folder: &Path,
    provenance: Provenance,
    on_progress: &OnProgress<'_>,
) -> Result<Option<QuestionResult>, ExperimentError> {
    let begun = Instant::now();
    let question = task.question.ask();
    if !matches!(model, ModelRecipe::Network(_)) && !question.takes_baselines() {
        return Err(ExperimentError::Recipe {
            origin: model.name().into(),
            reason: format!("the question `{}` needs a network", question.name()),
        });
    }
    let device = task
        .networks
        .device
        .open()
        .map_err(tactnet_pipeline::PipelineError::from)?;
    let networks = FinishedNetworks::of_task(folder);
    let context = StudyContext {
        dataset,
        data: &task.networks.data,
        model,
        device: &device,
        seed: task.networks.seed,
        part: task.part,
        networks: &networks,
        on_progress,
    };
    let answer = match question.answer(&context) {
        Ok(answer) => answer,
        Err(Cancelled::Stopped) => return Ok(None),
        Err(Cancelled::Failed(error)) => return Err(error),
    };
    let result = QuestionResult {
        schema_version: QuestionResult::SCHEMA_VERSION,
        task: task.clone(),
        data: dataset.name().into(),
        origin: dataset.origin(),
        data_sha256: dataset.sha256().into(),
        assumed_rate_hz: dataset.is_rate_assumed().then(|| dataset.sample_rate_hz()),
        materials: dataset.labels().names().map(String::from).collect(),
        steps: dataset.shape().steps,
        levels: model.levels(),
        device: task.networks.device,
        recipe: model.name().into(),
        recipe_sha256: sha256_hex(model.to_toml()),
        split: answer.split,
        split_sha256: sha256_hex(&answer.split_content),
        chosen: answer.chosen,
        measurements: answer.measurements,
        maps: answer.maps,
        seconds: begun.elapsed().as_secs_f64(),
        peak_rss_mib: tactnet_pipeline::peak_rss_mib(),
        provenance,
    };
    let mut text = serde_json::to_string_pretty(&result)
        .unwrap_or_else(|error| panic!("a result is always valid JSON: {error}"));
    text.push('\n');
    write_whole(&folder.join("result.json"), text.as_bytes())?;
    networks.remove()?;
    Ok(Some(result))
}
