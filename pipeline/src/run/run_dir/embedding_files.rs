//! Files that say what the training sweeps are like, for enrolment and for the detection of unknown materials and unlike sweeps:
//! embeddings, thresholds, descriptions.

use tactnet_models::Weights;

use super::{HELD_OUT, RunDir};
use crate::{
    Calibration, Classifier, Embedding, Likeness, PipelineError, Thresholds, TrainEmbeddings,
};

const KNOWN: &str = "known.safetensors";
const CALIBRATION: &str = "calibration.json";
const LIKENESS: &str = "likeness.safetensors";

impl RunDir {
    /// Reads the embeddings of a network's training sweeps.
    ///
    /// # Errors
    /// A missing or damaged file.
    pub fn train_embeddings(&self) -> Result<TrainEmbeddings, PipelineError> {
        let path = self.file(KNOWN);
        if !path.exists() {
            return Err(self.refused(
                "no known.safetensors, which a network's training writes at its end; train again with this version",
            ));
        }
        let materials = self.config()?.classifier.labels.len();
        let bytes = self.read(KNOWN)?;
        let damaged = |reason: String| PipelineError::run(path.clone(), reason);
        let weights =
            Weights::from_safetensors(&bytes).map_err(|error| damaged(error.to_string()))?;
        TrainEmbeddings::from_weights(&weights, materials).map_err(damaged)
    }

    /// Writes the embeddings of the training sweeps.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_train_embeddings(&self, known: &TrainEmbeddings) -> Result<(), PipelineError> {
        let metadata = [("format".to_string(), "tactnet known sweeps 1".to_string())].into();
        self.write(KNOWN, &known.to_weights().to_safetensors(metadata)?)
    }

    /// Reads the description of the training sweeps; returns `None` for a run with too few of them, or of an earlier
    /// version.
    ///
    /// # Errors
    /// A damaged file.
    pub fn likeness(&self) -> Result<Option<Likeness>, PipelineError> {
        let path = self.file(LIKENESS);
        if !path.exists() {
            return Ok(None);
        }
        let damaged = |reason: String| PipelineError::run(path.clone(), reason);
        let weights = Weights::from_safetensors(&self.read(LIKENESS)?)
            .map_err(|error| damaged(error.to_string()))?;
        let shape = self.config()?.classifier.taxel_shape();
        Likeness::from_weights(weights, shape)
            .map(Some)
            .map_err(damaged)
    }

    /// Writes the description of the training sweeps.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_likeness(&self, likeness: &Likeness) -> Result<(), PipelineError> {
        let metadata = [("format".to_string(), "tactnet likeness 1".to_string())].into();
        self.write(LIKENESS, &likeness.weights().to_safetensors(metadata)?)
    }

    /// Reads the thresholds of a calibrated classifier; returns `None` if it is not calibrated.
    ///
    /// # Errors
    /// A file that is damaged or of another version.
    pub fn calibration(&self) -> Result<Option<Calibration>, PipelineError> {
        if !self.file(CALIBRATION).exists() {
            return Ok(None);
        }
        let calibration: Calibration = self.read_json(CALIBRATION)?;
        if calibration.schema_version != Calibration::SCHEMA_VERSION {
            return Err(PipelineError::run(
                self.file(CALIBRATION),
                format!(
                    "expected schema version {}, found {}",
                    Calibration::SCHEMA_VERSION,
                    calibration.schema_version
                ),
            ));
        }
        Ok(Some(calibration))
    }

    /// Writes the thresholds.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_calibration(&self, calibration: &Calibration) -> Result<(), PipelineError> {
        self.write_json(CALIBRATION, calibration)
    }

    /// Reads the thresholds and the embeddings that they were fitted to; returns `None` if the classifier is not calibrated.
    ///
    /// - `classifier`: classifier of this run
    ///
    /// # Errors
    /// A file that is damaged or of another version.
    pub fn thresholds(&self, classifier: &Classifier) -> Result<Option<Thresholds>, PipelineError> {
        let Some(calibration) = self.calibration()? else {
            return Ok(None);
        };
        let path = self.file(HELD_OUT);
        let held_out = if path.exists() {
            let head = classifier.network()?.output_layer();
            let read = Weights::from_safetensors(&self.read(HELD_OUT)?)
                .map_err(|error| error.to_string())
                .and_then(|weights| Embedding::from_weights(&weights, &head));
            Some(read.map_err(|reason| PipelineError::run(path, reason))?)
        } else {
            None
        };
        Ok(Some(Thresholds {
            calibration,
            held_out,
        }))
    }

    /// Writes the embeddings of the calibration sweeps.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_held_out(&self, held_out: &Embedding) -> Result<(), PipelineError> {
        let metadata = [(
            "format".to_string(),
            "tactnet held-out sweeps 1".to_string(),
        )]
        .into();
        self.write(HELD_OUT, &held_out.to_weights().to_safetensors(metadata)?)
    }
}
