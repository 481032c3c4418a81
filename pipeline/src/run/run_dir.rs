//! Run directories: the files of one run, each written atomically.
//!
//! | file | content | written |
//! |---|---|---|
//! | `config.json` | recipe, data source, seed, classifier (normaliser, labels, shape) | before training |
//! | `split.json` | the split, hashed | before training |
//! | `environment.json` | program, commit, machine of every session | before training, at a resume elsewhere |
//! | `.lock` | lock of the training process | during training |
//! | `metrics.jsonl` | one line per epoch | after every epoch |
//! | `checkpoint.safetensors` | weights, optimiser state, position | at least once a minute and at every stop |
//! | `weights.safetensors` | final weights and running statistics | at the end |
//! | `known.safetensors` | embeddings of the training sweeps for enrolment, networks only | at the end |
//! | `likeness.safetensors` | description of the training sweeps, to tell whether others are like them | at the end |
//! | `calibration.json` | thresholds for unknown materials and prediction sets, if calibrated | at the end |
//! | `held_out.safetensors` | embeddings of the calibration sweeps, to refit the thresholds at an enrolment | at the end |
//! | `enrolled.json` | materials added after training | at an enrolment |
//! | `adapted.json` | sweeps that the classifier was adapted to | at an adaptation |
//! | `predictions_test.csv` | scores of every test sweep in tsml format | at the end |
//! | `confusion.svg` | confusion matrix | at the end |
//! | `result.json` | evaluation of the test sweeps | at the end |
//! | `manifest.json` | SHA-256 of all other files except the checkpoint; a later change is an error | last |

mod derived_run;
mod embedding_files;
mod folder_lock;
mod manifest;
mod verified_result;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use serde::{Serialize, de::DeserializeOwned};
use tactnet_data::{SplitManifest, read_file, read_text};
use tactnet_models::Weights;

use folder_lock::LOCK;
use manifest::Manifest;

use crate::network::checkpoint::{decode_checkpoint, encode_checkpoint};
use crate::{
    Adaptation, EnrolledMaterial, EpochMetrics, PipelineError, PipelineRemedy, PredictionMethod,
    Predictions, Provenance, RunConfig, RunResult, TrainingState, write_whole,
};

const CONFIG: &str = "config.json";
const SPLIT: &str = "split.json";
const ENVIRONMENT: &str = "environment.json";
const RESULT: &str = "result.json";
const WEIGHTS: &str = "weights.safetensors";
const HELD_OUT: &str = "held_out.safetensors";
const ENROLLED: &str = "enrolled.json";
const ADAPTED: &str = "adapted.json";

/// Folder that holds one run.
#[derive(Debug)]
pub struct RunDir {
    path: PathBuf,
    /// Lock held while this process trains. The operating system releases it at the end of the process, even after a crash.
    lock: Option<fs::File>,
    /// Digests of the files, once read.
    manifest: OnceLock<Option<Manifest>>,
    /// Configuration, once read or written.
    config: OnceLock<RunConfig>,
}

impl RunDir {
    /// Creates a new run directory, writes everything that is known before training, and locks it.
    ///
    /// # Errors
    /// A folder that is not empty; a file that cannot be written.
    pub fn create(
        path: &Path,
        config: &RunConfig,
        split: &SplitManifest,
        provenance: &Provenance,
    ) -> Result<Self, PipelineError> {
        let failed = |error| PipelineError::io(path, "make the run directory", error);
        fs::create_dir_all(path).map_err(failed)?;
        let run = Self::unopened(path).locked()?;
        if run.file(CONFIG).exists() {
            let ended = run.result().is_ok_and(|result| result.is_some());
            return Err(if ended {
                run.refused("the folder holds a run already, which has ended")
                    .with_remedy(PipelineRemedy::NameFolder)
            } else {
                let run_dir = run.path.clone();
                run.refused("the folder holds a run already")
                    .with_remedy(PipelineRemedy::ResumeOrNameFolder { run: run_dir })
            });
        }
        for entry in fs::read_dir(path).map_err(failed)? {
            let name = entry.map_err(failed)?.file_name();
            // Files of a process that was killed before it wrote the configuration.
            let begun = [LOCK, SPLIT, ENVIRONMENT].iter().any(|file| name == *file);
            if !begun {
                let name = name.to_string_lossy();
                let error = run.refused(format!("a new run needs an empty folder, found `{name}`"));
                return Err(error.with_remedy(PipelineRemedy::NameFolder));
            }
        }
        run.write_json(SPLIT, split)?;
        run.write_json(ENVIRONMENT, &[provenance])?;
        // Written last, since a folder with this file counts as a run.
        run.write_json(CONFIG, config)?;
        run.config.get_or_init(|| config.clone());
        Ok(run)
    }

    pub(super) fn unopened(path: &Path) -> Self {
        Self {
            path: path.to_path_buf(),
            lock: None,
            manifest: OnceLock::new(),
            config: OnceLock::new(),
        }
    }

    /// Opens an existing run directory for reading.
    ///
    /// # Errors
    /// A folder without a `config.json`.
    pub fn open(path: &Path) -> Result<Self, PipelineError> {
        let run = Self::unopened(path);
        if run.file(CONFIG).is_file() {
            return Ok(run);
        }
        let below = runs_below(path);
        let found = format!("no run here (no {CONFIG})");
        Err(match &below[..] {
            [] => run.refused(found).with_remedy(PipelineRemedy::NameRun),
            [one] => run.refused(format!("{found}; name the one below: {one}")),
            [first, ..] => {
                let count = below.len();
                run.refused(format!(
                    "{found}; name one of the {count} below, such as {first}"
                ))
            }
        })
    }

    /// Returns the file name of predictions by `method`, in a run whose recipe uses the method `own`.
    pub(crate) fn predictions_file(method: PredictionMethod, own: PredictionMethod) -> String {
        if method == own {
            "predictions_test.csv".into()
        } else {
            format!("predictions_test_{}.csv", method.name())
        }
    }

    /// Returns the test predictions by `method`, with the name of their file.
    ///
    /// # Errors
    /// A missing or damaged file.
    pub fn predictions(
        &self,
        method: PredictionMethod,
    ) -> Result<(String, Predictions), PipelineError> {
        let config = self.config()?;
        let file = Self::predictions_file(method, config.recipe.method());
        let path = self.file(&file);
        let text = self.read_text(&file)?;
        let test = self.split()?.test;
        let predictions = Predictions::from_tsml(&text, config.classifier.labels, method, &test)
            .map_err(|reason| PipelineError::run(path, reason))?;
        Ok((file, predictions))
    }

    /// Adds a session to `environment.json` if program or machine differ from the last one; returns all sessions.
    ///
    /// # Errors
    /// A file that is missing, damaged, or cannot be written.
    pub fn record_session(
        &self,
        provenance: &Provenance,
    ) -> Result<Vec<Provenance>, PipelineError> {
        let mut sessions: Vec<Provenance> = self.read_json(ENVIRONMENT)?;
        if sessions.last() != Some(provenance) {
            sessions.push(provenance.clone());
            self.write_json(ENVIRONMENT, &sessions)?;
        }
        Ok(sessions)
    }

    pub(super) fn refused(&self, reason: impl Into<String>) -> PipelineError {
        PipelineError::run(self.path.clone(), reason)
    }

    /// Returns the path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the configuration, which is read from `config.json` at most once.
    ///
    /// # Errors
    /// A file that is missing, damaged, or of an unsupported version.
    pub fn config(&self) -> Result<RunConfig, PipelineError> {
        if let Some(known) = self.config.get() {
            return Ok(known.clone());
        }
        let path = self.file(CONFIG);
        let text = self.read_text(CONFIG)?;
        let config =
            RunConfig::from_json(&text).map_err(|reason| PipelineError::run(path, reason))?;
        Ok(self.config.get_or_init(|| config).clone())
    }

    /// Reads `split.json`.
    ///
    /// # Errors
    /// A missing or damaged file.
    pub fn split(&self) -> Result<SplitManifest, PipelineError> {
        self.read_json(SPLIT)
    }

    /// Reads `result.json`; returns `None` if the run has not ended.
    ///
    /// # Errors
    /// A damaged file.
    pub fn result(&self) -> Result<Option<RunResult>, PipelineError> {
        if self.file(RESULT).exists() {
            self.read_json(RESULT).map(Some)
        } else {
            Ok(None)
        }
    }

    /// Reads the materials that were added after training, in order.
    ///
    /// # Errors
    /// A damaged file.
    pub fn enrolled(&self) -> Result<Vec<EnrolledMaterial>, PipelineError> {
        if self.file(ENROLLED).exists() {
            self.read_json(ENROLLED)
        } else {
            Ok(Vec::new())
        }
    }

    /// Reads the adaptations after training, in order.
    ///
    /// # Errors
    /// A damaged file.
    pub fn adaptations(&self) -> Result<Vec<Adaptation>, PipelineError> {
        if self.file(ADAPTED).exists() {
            self.read_json(ADAPTED)
        } else {
            Ok(Vec::new())
        }
    }

    /// Writes the adaptations after training.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_adaptations(&self, adaptations: &[Adaptation]) -> Result<(), PipelineError> {
        self.write_json(ADAPTED, &adaptations)
    }

    /// Returns true if training has ended, so that the weights are final.
    pub fn has_final_weights(&self) -> bool {
        self.file(WEIGHTS).exists()
    }

    /// Reads the final weights.
    ///
    /// # Errors
    /// A training that has not ended; a damaged file.
    pub fn final_weights(&self) -> Result<Weights, PipelineError> {
        if self.has_final_weights() {
            return self.weights();
        }
        Err(self.no_final_weights())
    }

    /// Returns the error about a run without final weights.
    pub fn no_final_weights(&self) -> PipelineError {
        if self.file(RESULT).exists() {
            return self.refused(format!(
                "the run has ended, but its {WEIGHTS} is missing; copy it back, or train again"
            ));
        }
        self.refused("the run has not ended")
            .with_remedy(PipelineRemedy::Resume {
                run: self.path.clone(),
            })
    }

    /// Reads the last checkpoint and the training time until then in seconds; returns `None` before the first one.
    ///
    /// # Errors
    /// A damaged file.
    pub fn checkpoint(&self) -> Result<Option<(TrainingState, f64)>, PipelineError> {
        let path = self.file("checkpoint.safetensors");
        if !path.exists() {
            return Ok(None);
        }
        let bytes = read_file(&path).map_err(|error| PipelineError::io(&path, "read", error))?;
        decode_checkpoint(&bytes)
            .map(Some)
            .map_err(|reason| PipelineError::run(path, reason))
    }

    /// Replaces the checkpoint.
    ///
    /// # Errors
    /// A file that cannot be written; the previous checkpoint is then intact.
    pub fn write_checkpoint(
        &self,
        state: &TrainingState,
        seconds: f64,
    ) -> Result<(), PipelineError> {
        let bytes = encode_checkpoint(state, seconds)?;
        self.write("checkpoint.safetensors", &bytes)
    }

    /// Reads the metrics of the epochs before `epoch`, counted from 1.
    ///
    /// # Errors
    /// A damaged file.
    pub fn metrics_before(&self, epoch: usize) -> Result<Vec<EpochMetrics>, PipelineError> {
        let path = self.file("metrics.jsonl");
        if !path.exists() {
            return Ok(Vec::new());
        }
        let text = read_text(&path).map_err(|error| PipelineError::io(&path, "read", error))?;
        let mut metrics = Vec::new();
        for line in text.lines() {
            let line: EpochMetrics = serde_json::from_str(line)
                .map_err(|error| PipelineError::run(path.clone(), error.to_string()))?;
            metrics.push(line);
        }
        metrics.retain(|line| line.epoch < epoch);
        Ok(metrics)
    }

    /// Replaces `metrics.jsonl`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_metrics(&self, metrics: &[EpochMetrics]) -> Result<(), PipelineError> {
        let mut text = String::new();
        for line in metrics {
            let line = serde_json::to_string(line);
            text.push_str(&as_json("metrics.jsonl", line)?);
            text.push('\n');
        }
        self.write("metrics.jsonl", text.as_bytes())
    }

    /// Reads the final weights, or those of the checkpoint if the run has not ended.
    ///
    /// # Errors
    /// Neither file exists, or the file is damaged.
    pub fn weights(&self) -> Result<Weights, PipelineError> {
        let path = self.file(WEIGHTS);
        if path.exists() {
            let bytes = self.read(WEIGHTS)?;
            return Weights::from_safetensors(&bytes)
                .map_err(|error| PipelineError::run(path, error.to_string()));
        }
        match self.checkpoint()? {
            Some((state, _)) => Ok(state.weights),
            None => Err(self.refused("the run has no weights yet").with_remedy(
                PipelineRemedy::Resume {
                    run: self.path.clone(),
                },
            )),
        }
    }

    /// Writes a network's final weights.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_weights(&self, weights: &Weights) -> Result<(), PipelineError> {
        let metadata = [("format".to_string(), "tactnet weights 1".to_string())].into();
        self.write(WEIGHTS, &weights.to_safetensors(metadata)?)
    }

    /// Writes the fitted parameters of a baseline.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_baseline(&self, weights: &Weights) -> Result<(), PipelineError> {
        let metadata = [("format".to_string(), "tactnet baseline 1".to_string())].into();
        self.write(WEIGHTS, &weights.to_safetensors(metadata)?)
    }

    /// Writes a file of the run.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), PipelineError> {
        write_whole(&self.file(name), bytes)
    }

    /// Writes `value` as a JSON file.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<(), PipelineError> {
        let text = as_json(name, serde_json::to_string_pretty(value))?;
        self.write(name, format!("{text}\n").as_bytes())
    }

    pub(super) fn read_json<T: DeserializeOwned>(&self, name: &str) -> Result<T, PipelineError> {
        serde_json::from_str(&self.read_text(name)?)
            .map_err(|error| PipelineError::run(self.file(name), error.to_string()))
    }

    fn read_text(&self, name: &str) -> Result<String, PipelineError> {
        String::from_utf8(self.read(name)?)
            .map_err(|error| PipelineError::run(self.file(name), error.to_string()))
    }

    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }
}

/// Returns the run directories directly below a folder, sorted by name.
fn runs_below(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut runs: Vec<String> = entries
        .map(|entry| entry.path())
        .filter(|path| path.join(CONFIG).is_file())
        .map(|path| path.display().to_string())
        .collect();
    runs.sort();
    runs
}

fn as_json(name: &str, text: serde_json::Result<String>) -> Result<String, PipelineError> {
    text.map_err(|error| PipelineError::run(name, error.to_string()))
}
