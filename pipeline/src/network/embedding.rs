//! Layer outputs of a network for sweeps.

use tactnet_data::SweepView;
use tactnet_models::{Features, LinearHead, NamedTensor, Weights, log_softmax};

/// Layer outputs for every sweep of a view, in the order of its positions.
#[derive(Debug, Clone)]
pub struct Embedding {
    /// Label of every sweep.
    pub labels: Vec<usize>,
    /// Output of the convolutions before dropout, `[sweeps][features]` (2048 for TactMat).
    pub convolution: Features,
    /// Input of the output layer, `[sweeps][hidden]` (512).
    pub hidden: Features,
    /// Scores of the output layer, `[sweeps][materials]`.
    pub logits: Features,
}

impl Embedding {
    /// Returns the means of the embeddings of the parts of sweeps.
    ///
    /// - `parts`: positions of sweeps with their embeddings; every position occurs at least once
    pub(crate) fn mean_of(labels: Vec<usize>, parts: Vec<(&[usize], Self)>) -> Self {
        let mut counts = vec![0.0_f32; labels.len()];
        for (positions, _) in &parts {
            positions
                .iter()
                .for_each(|position| counts[*position] += 1.0);
        }
        let mean = |layer: fn(&Self) -> &Features| {
            let width = parts.first().map_or(1, |(_, part)| layer(part).width());
            let mut means = Features::new(width, vec![0.0; labels.len() * width]);
            for (positions, part) in &parts {
                for (position, row) in positions.iter().zip(layer(part).rows()) {
                    let mean = means.row_mut(*position).iter_mut().zip(row);
                    mean.for_each(|(mean, value)| *mean += value / counts[*position]);
                }
            }
            means
        };
        Self {
            convolution: mean(|part| &part.convolution),
            hidden: mean(|part| &part.hidden),
            logits: mean(|part| &part.logits),
            labels,
        }
    }

    /// Returns the number of sweeps.
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Returns true if it has no sweeps.
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Returns the sweeps at `positions`, in that order.
    pub fn select(&self, positions: &[usize]) -> Self {
        Self {
            labels: positions.iter().map(|&p| self.labels[p]).collect(),
            convolution: self.convolution.select(positions),
            hidden: self.hidden.select(positions),
            logits: self.logits.select(positions),
        }
    }

    /// Returns the sweeps of `part`, a view within the view `whole` of this embedding.
    ///
    /// # Panics
    /// If a sweep of `part` is not in `whole`.
    pub fn part(&self, whole: &SweepView<'_>, part: &SweepView<'_>) -> Self {
        let positions: Vec<usize> = part
            .indices()
            .iter()
            .map(|index| {
                whole
                    .indices()
                    .binary_search(index)
                    .unwrap_or_else(|_| panic!("sweep {index} has been embedded"))
            })
            .collect();
        self.select(&positions)
    }

    /// Returns the same sweeps with the scores of another output layer on the same network.
    pub fn scored_by(self, head: &LinearHead) -> Self {
        let scores = head.scores(&self.hidden).concat();
        Self {
            logits: Features::new(
                head.biases.len(),
                scores.into_iter().map(|score| score as f32).collect(),
            ),
            ..self
        }
    }

    /// Returns the tensors `convolution`, `hidden` and `labels`.
    pub fn to_weights(&self) -> Weights {
        let matrix = |features: &Features| NamedTensor {
            shape: vec![features.len(), features.width()],
            values: features.values().to_vec(),
        };
        let labels = NamedTensor {
            shape: vec![self.len()],
            values: self.labels.iter().map(|label| *label as f32).collect(),
        };
        Weights(
            [
                ("convolution", matrix(&self.convolution)),
                ("hidden", matrix(&self.hidden)),
                ("labels", labels),
            ]
            .map(|(name, tensor)| (name.to_string(), tensor))
            .into(),
        )
    }

    /// Restores an embedding from the tensors of [`Embedding::to_weights`], scored by an output layer.
    ///
    /// # Errors
    /// A sentence about the first invalid tensor.
    pub fn from_weights(weights: &Weights, head: &LinearHead) -> Result<Self, String> {
        let tensor = |name: &str| weights.0.get(name).ok_or(format!("no tensor `{name}`"));
        let labels: Vec<usize> = tensor("labels")?
            .values
            .iter()
            .map(|label| *label as usize)
            .collect();
        let matrix = |name: &str| match tensor(name)? {
            NamedTensor { shape, values } if shape[..1] == [labels.len()] && shape.len() == 2 => {
                Ok(Features::new(shape[1].max(1), values.clone()))
            }
            other => Err(format!(
                "`{name}`: expected a row for each of {} sweeps, found {:?}",
                labels.len(),
                other.shape
            )),
        };
        let (convolution, hidden) = (matrix("convolution")?, matrix("hidden")?);
        let width = head.weights.first().map_or(0, Vec::len);
        if hidden.width() != width {
            return Err(format!(
                "`hidden`: expected {width} features, found {}",
                hidden.width()
            ));
        }
        if let Some(label) = labels.iter().find(|label| **label >= head.biases.len()) {
            return Err(format!(
                "expected labels below {}, found {label}",
                head.biases.len()
            ));
        }
        let unscored = Self {
            logits: Features::new(1, Vec::new()),
            labels,
            convolution,
            hidden,
        };
        Ok(unscored.scored_by(head))
    }

    /// Returns the log-probabilities of a plain prediction, `[sweeps][materials]`.
    pub fn log_probabilities(&self) -> Vec<Vec<f64>> {
        self.logits.rows().map(log_softmax).collect()
    }
}
