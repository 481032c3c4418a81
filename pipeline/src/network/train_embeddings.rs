//! Embeddings of a classifier's training sweeps, kept for later enrolments.

use tactnet_models::{Features, NamedTensor, Weights};

use crate::Embedding;

/// Embeddings of the training sweeps of a classifier, with their labels.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainEmbeddings {
    /// Input of the output layer, `[sweeps][hidden]`.
    pub hidden: Features,
    /// Label of every sweep.
    pub labels: Vec<usize>,
}

impl TrainEmbeddings {
    /// Returns the embeddings without convolution outputs and scores.
    pub fn of(embedding: &Embedding) -> Self {
        Self {
            hidden: embedding.hidden.clone(),
            labels: embedding.labels.clone(),
        }
    }

    /// Returns the tensors `hidden` and `labels`.
    pub fn to_weights(&self) -> Weights {
        let labels = self.labels.iter().map(|label| *label as f32).collect();
        Weights(
            [
                (
                    "hidden".to_string(),
                    NamedTensor {
                        shape: vec![self.hidden.len(), self.hidden.width()],
                        values: self.hidden.values().to_vec(),
                    },
                ),
                (
                    "labels".to_string(),
                    NamedTensor {
                        shape: vec![self.labels.len()],
                        values: labels,
                    },
                ),
            ]
            .into(),
        )
    }

    /// Restores embeddings from the tensors of [`TrainEmbeddings::to_weights`].
    ///
    /// - `materials`: number of materials, which bounds the labels
    ///
    /// # Errors
    /// A sentence about the first invalid tensor.
    pub fn from_weights(weights: &Weights, materials: usize) -> Result<Self, String> {
        let tensor = |name: &str| weights.0.get(name).ok_or(format!("no tensor `{name}`"));
        let (hidden, labels) = (tensor("hidden")?, tensor("labels")?);
        let [sweeps, width] = hidden.shape[..] else {
            return Err(format!(
                "`hidden`: expected two extents, found {:?}",
                hidden.shape
            ));
        };
        if width == 0 || labels.values.len() != sweeps {
            return Err(format!(
                "expected a label for each of {sweeps} sweeps, found {}",
                labels.values.len()
            ));
        }
        let labels: Vec<usize> = labels.values.iter().map(|label| *label as usize).collect();
        if let Some(label) = labels.iter().find(|label| **label >= materials) {
            return Err(format!("expected labels below {materials}, found {label}"));
        }
        Ok(Self {
            hidden: Features::new(width, hidden.values.clone()),
            labels,
        })
    }
}
