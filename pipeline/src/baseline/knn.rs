//! k nearest neighbours.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use tactnet_models::{Features, Knn, Weights, argmax};

use super::method::{Fit, FittedMethod, Labelled, Method, Stored, TrainFeatures, fewest};
use crate::PipelineError;
use crate::error::InvalidSetting;
use crate::features::arrays::{get_indices_below, of_length, put, put_indices};

/// Settings of k nearest neighbours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnnRecipe {
    /// Candidates for k.
    pub neighbours: Vec<usize>,
}

impl Method for KnnRecipe {
    fn validate(&self) -> Result<(), InvalidSetting> {
        if !self.neighbours.is_empty() && !self.neighbours.contains(&0) {
            return Ok(());
        }
        Err(InvalidSetting {
            setting: "classifier.neighbours",
            expected: "whole numbers from 1",
            found: format!("{:?}", self.neighbours),
        })
    }

    /// A fixed k needs k sweeps in total.
    fn starved(&self, counts: &[usize]) -> Option<(usize, usize)> {
        let [k] = self.neighbours[..] else {
            return fewest(counts)
                .filter(|label| counts[*label] < 2)
                .map(|label| (label, 2));
        };
        let all: usize = counts.iter().sum();
        let needed = k.div_ceil(counts.len().max(1));
        fewest(counts)
            .filter(|_| all < k)
            .map(|label| (label, needed))
    }

    fn fit(
        &self,
        train: TrainFeatures<'_>,
        progress: &mut dyn FnMut(String),
    ) -> Result<Fit, PipelineError> {
        let knn = |train: Labelled, materials: usize, neighbours: usize| Knn {
            features: train.features,
            labels: train.labels,
            materials,
            neighbours,
        };
        let k = train.choose(&self.neighbours, progress, |k, fitted, held| {
            let scores = knn(fitted, train.materials, k).log_probabilities(held);
            Ok(scores.iter().map(|row| argmax(row)).collect())
        })?;
        let mut chosen = BTreeMap::new();
        if self.neighbours.len() > 1 {
            chosen.insert("neighbours".into(), k as f64);
        }
        let (all, scaler) = train.all();
        Ok(Fit {
            classifier: Box::new(knn(all, train.materials, k)),
            scaler,
            chosen,
        })
    }

    fn load(&self, stored: &Stored<'_>) -> Result<Box<dyn FittedMethod>, PipelineError> {
        let (weights, materials) = (stored.weights, stored.materials);
        let features = stored.features("knn.features")?;
        let labels = get_indices_below(weights, "knn.labels", materials)?;
        of_length("knn.labels", labels.len(), features.len())?;
        let neighbours = get_indices_below(weights, "knn.neighbours", labels.len() + 1)?;
        of_length("knn.neighbours", neighbours.len(), 1)?;
        Ok(Box::new(Knn {
            features,
            labels,
            materials,
            neighbours: neighbours[0].max(1),
        }))
    }
}

impl FittedMethod for Knn {
    fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        Self::log_probabilities(self, features)
    }

    fn save(&self, weights: &mut Weights) {
        put(weights, "knn.features", self.features.values().to_vec());
        put_indices(weights, "knn.labels", &self.labels);
        put_indices(weights, "knn.neighbours", &[self.neighbours]);
    }
}
