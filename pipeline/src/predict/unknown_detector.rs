//! Detection of unknown materials by calibrated thresholds.

use tactnet_data::SweepView;

use super::judged_sweeps::JudgedSweeps;
use crate::{
    Calibration, Classifier, ModelConfig, NoveltyScore, PipelineError, RunDir, TrainEmbeddings,
    Verdict,
};

/// Thresholds of a calibrated classifier, with everything that its novelty scores need.
#[derive(Debug, Clone)]
pub struct UnknownDetector {
    /// Thresholds.
    pub calibration: Calibration,
    /// Embeddings of a network's training sweeps; `None` for committees.
    pub embeddings: Option<TrainEmbeddings>,
}

impl UnknownDetector {
    /// Returns the verdict on every sweep of `view`.
    ///
    /// - `classifier`: classifier of the thresholds
    ///
    /// # Errors
    /// Sweeps of another shape or rate.
    pub fn assess(
        &self,
        classifier: &Classifier,
        view: &SweepView<'_>,
    ) -> Result<Vec<Verdict>, PipelineError> {
        let (score, known) = (self.calibration.score, self.embeddings.as_ref());
        let judged = JudgedSweeps::of(classifier, score, known, view)?;
        Ok(self.calibration.assess(judged))
    }
}

/// Returns the novelty score of every sweep that `train --calibrate` would use.
///
/// - `known`: embeddings of a network's training sweeps; committees need none
///
/// # Errors
/// Sweeps of another shape or rate; a baseline.
pub fn novelty_scores(
    classifier: &Classifier,
    known: Option<&TrainEmbeddings>,
    view: &SweepView<'_>,
) -> Result<Vec<f64>, PipelineError> {
    let score = NoveltyScore::best_for(&classifier.config().model);
    Ok(JudgedSweeps::of(classifier, score, known, view)?.scores)
}

impl RunDir {
    /// Reads the thresholds for unknown materials; returns `None` if the classifier is not calibrated.
    ///
    /// # Errors
    /// A file that is damaged or of another version.
    pub fn unknown_detector(&self) -> Result<Option<UnknownDetector>, PipelineError> {
        let Some(calibration) = self.calibration()? else {
            return Ok(None);
        };
        let embeddings = match self.config()?.classifier.model {
            ModelConfig::Committee(_) => None,
            ModelConfig::Network(_) | ModelConfig::Baseline(_) => Some(self.train_embeddings()?),
        };
        Ok(Some(UnknownDetector {
            calibration,
            embeddings,
        }))
    }
}
