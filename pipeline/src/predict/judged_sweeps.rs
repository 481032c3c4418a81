//! Novelty scores and probabilities of sweeps, to which thresholds are fitted and with which they are compared.

use tactnet_data::SweepView;
use tactnet_models::argmax;

use crate::{Classifier, Embedding, NoveltyScore, NoveltyScorer, PipelineError, TrainEmbeddings};

/// Novelty scores and probabilities of sweeps.
#[derive(Debug, Clone, Default)]
pub(crate) struct JudgedSweeps {
    /// Novelty score of every sweep.
    pub(crate) scores: Vec<f64>,
    /// Plain log-probabilities, `[sweeps][materials]`.
    pub(crate) log_probabilities: Vec<Vec<f64>>,
    /// Label of every sweep.
    pub(crate) labels: Vec<usize>,
}

impl JudgedSweeps {
    /// Scores sweeps by a network or committee.
    ///
    /// - `known`: embeddings of a network's training sweeps; committees need none
    ///
    /// # Errors
    /// Sweeps of another shape or rate; a baseline; a score that the model does not have.
    pub(crate) fn of(
        classifier: &Classifier,
        score: NoveltyScore,
        known: Option<&TrainEmbeddings>,
        view: &SweepView<'_>,
    ) -> Result<Self, PipelineError> {
        if let Some(committee) = classifier.committee() {
            return committee.judge(score, view);
        }
        let embedding = classifier.embed(view)?;
        let known = known.ok_or_else(|| {
            let expected = "embeddings of the training sweeps";
            PipelineError::incompatible("novelty score", expected, "none")
        })?;
        Self::of_embedding(score, &NoveltyScorer::fit(classifier, known)?, &embedding)
    }

    /// Scores embedded sweeps by a network.
    ///
    /// # Errors
    /// A model that is not a network.
    pub(crate) fn of_embedding(
        score: NoveltyScore,
        scorer: &NoveltyScorer<'_>,
        embedding: &Embedding,
    ) -> Result<Self, PipelineError> {
        Ok(Self {
            scores: scorer.score(score, embedding)?,
            log_probabilities: embedding.log_probabilities(),
            labels: embedding.labels.clone(),
        })
    }

    /// Returns the share of sweeps whose most probable material is the true one; 0 without sweeps.
    pub(crate) fn accuracy(&self) -> f64 {
        let rows = self.log_probabilities.iter().zip(&self.labels);
        let right = rows.filter(|(row, label)| argmax(row) == **label).count();
        right as f64 / self.labels.len().max(1) as f64
    }

    pub(crate) fn append(&mut self, mut other: Self) {
        self.scores.append(&mut other.scores);
        self.log_probabilities.append(&mut other.log_probabilities);
        self.labels.append(&mut other.labels);
    }
}
