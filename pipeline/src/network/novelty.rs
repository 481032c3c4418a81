//! Novelty scores of sweeps, which are larger for materials that the network has not seen.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_models::{NearestMean, Whitening};

use crate::{Classifier, Embedding, ModelConfig, PipelineError, TrainEmbeddings};

/// Weight of the mean variance in the shrunk covariance of known sweeps.
const SHRINKAGE: f64 = 0.3;
/// Number of passes of Monte Carlo dropout.
pub(crate) const MC_SAMPLES: usize = 100;

/// Score that is larger for less familiar sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoveltyScore {
    /// Negative log of the summed exponentials of the output layer's scores (Liu et al., 2020).
    Energy,
    /// Negative log of the largest probability (Hendrycks & Gimpel, 2017).
    LargestProbability,
    /// Mutual information of label and dropout masks, in nats (Gal & Ghahramani, 2016).
    MutualInformation,
    /// Half the squared distance to the nearest class mean, whitened with the covariance of known sweeps (Lee et al., 2018).
    WhitenedDistance,
}

impl NoveltyScore {
    /// All scores.
    pub const ALL: [Self; 4] = [
        Self::Energy,
        Self::LargestProbability,
        Self::MutualInformation,
        Self::WhitenedDistance,
    ];

    /// Score with the best detection of the twin's unknown materials (experiment `unknown`, RESULTS.md).
    pub const BEST: Self = Self::MutualInformation;

    /// Returns the score that a calibration of a model uses; see the experiment in docs/training.md.
    pub(crate) fn best_for(model: &ModelConfig) -> Self {
        match model {
            ModelConfig::Committee(_) => Self::LargestProbability,
            ModelConfig::Network(_) | ModelConfig::Baseline(_) => Self::BEST,
        }
    }

    /// Returns the name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::LargestProbability => "largest probability",
            Self::MutualInformation => "mutual information",
            Self::WhitenedDistance => "whitened distance",
        }
    }
}

/// Classifier with means and covariance of its training sweeps, which novelty scores need.
pub struct NoveltyScorer<'a> {
    classifier: &'a Classifier,
    whitening: Whitening,
    means: NearestMean,
}

impl<'a> NoveltyScorer<'a> {
    /// Fits means and covariance to the embeddings of the training sweeps.
    ///
    /// # Errors
    /// A model that is not a network; a covariance without eigenvalues.
    pub fn fit(classifier: &'a Classifier, known: &TrainEmbeddings) -> Result<Self, PipelineError> {
        classifier.network()?;
        let materials = classifier.config().labels.len();
        let whitening = Whitening::fit(&known.hidden, &known.labels, materials, SHRINKAGE)?;
        let whitened = whitening.apply(&known.hidden);
        Ok(Self {
            classifier,
            means: NearestMean::fit(&whitened, &known.labels, materials),
            whitening,
        })
    }

    /// Returns one score for every sweep.
    ///
    /// # Errors
    /// A model that is not a network.
    pub fn score(
        &self,
        score: NoveltyScore,
        embedding: &Embedding,
    ) -> Result<Vec<f64>, PipelineError> {
        let largest = |row: &[f64]| row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(match score {
            NoveltyScore::Energy => embedding
                .logits
                .rows()
                .zip(embedding.log_probabilities())
                .map(|(scores, log_p)| log_p[0] - f64::from(scores[0]))
                .collect(),
            NoveltyScore::LargestProbability => embedding
                .log_probabilities()
                .iter()
                .map(|row| -largest(row))
                .collect(),
            NoveltyScore::MutualInformation => {
                self.classifier.mutual_information(embedding, MC_SAMPLES)?
            }
            NoveltyScore::WhitenedDistance => self
                .means
                .scores(&self.whitening.apply(&embedding.hidden))
                .iter()
                .map(|row| -largest(row))
                .collect(),
        })
    }

    /// Returns all scores of every sweep, by name.
    ///
    /// # Errors
    /// A model that is not a network.
    pub fn all(
        &self,
        embedding: &Embedding,
    ) -> Result<BTreeMap<&'static str, Vec<f64>>, PipelineError> {
        NoveltyScore::ALL
            .into_iter()
            .map(|score| Ok((score.name(), self.score(score, embedding)?)))
            .collect()
    }
}
