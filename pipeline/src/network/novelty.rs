//! How strange a sweep is to a network: scores that grow for materials that it has never seen.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_models::{NearestMean, Whitening};

use crate::{Classifier, Embedding, PipelineError, TrainEmbeddings};

/// Share of the mean variance in the covariance of known sweeps.
const SHRINKAGE: f64 = 0.3;
/// Passes of Monte Carlo dropout.
pub(crate) const MC_SAMPLES: usize = 100;

/// A score that is larger for stranger sweeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoveltyScore {
    /// Minus the log of the summed exponentials of the output layer's scores (Liu et al., 2020).
    Energy,
    /// Minus the log of the largest probability (Hendrycks & Gimpel, 2017).
    LargestProbability,
    /// Mutual information of label and dropout masks (Gal & Ghahramani, 2016), nats.
    MutualInformation,
    /// Half the squared distance to the nearest class mean, whitened with the known sweeps' covariance (Lee et al., 2018).
    WhitenedDistance,
}

impl NoveltyScore {
    /// All of them.
    pub const ALL: [Self; 4] = [
        Self::Energy,
        Self::LargestProbability,
        Self::MutualInformation,
        Self::WhitenedDistance,
    ];

    /// The one that tells unknown materials of the twin best (`tactnet experiment run unknown`, RESULTS.md).
    pub const BEST: Self = Self::MutualInformation;

    /// Its name in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::Energy => "energy",
            Self::LargestProbability => "largest probability",
            Self::MutualInformation => "mutual information",
            Self::WhitenedDistance => "whitened distance",
        }
    }
}

/// What scores need besides the network: means and covariance of the sweeps that it learnt from.
pub struct NoveltyScorer<'a> {
    classifier: &'a Classifier,
    whitening: Whitening,
    means: NearestMean,
}

impl<'a> NoveltyScorer<'a> {
    /// Fits to the sweeps behind `classifier`.
    ///
    /// # Errors
    /// A model that is no network; a covariance without eigenvalues.
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

    /// One score for every sweep.
    ///
    /// # Errors
    /// None with a network.
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

    /// All scores of every sweep, by name.
    ///
    /// # Errors
    /// None with a network.
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
