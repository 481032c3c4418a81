//! Transfer methods on few embedded sweeps.

use tactnet_data::Seed;
use tactnet_models::{
    DenseWeights, Features, LinearHead, NearestMean, SimpleShot, WeightPrior, argmax,
};
use tactnet_pipeline::{Device, Embedding, MlpTraining, NetworkRecipe, fit_labels};

use super::TransferMethod;
use super::knowledge::{Knowledge, squared_distance};
use crate::context::Cancelled;

/// Approximate number of optimiser steps for fine-tuning the dense layer.
const FINE_TUNING_STEPS: usize = 150;

/// Few embedded sweeps of new materials.
pub(super) struct FewShots<'a> {
    pub(super) knowledge: &'a Knowledge,
    pub(super) recipe: &'a NetworkRecipe,
    pub(super) device: &'a Device,
    pub(super) support: &'a Embedding,
    pub(super) materials: usize,
    pub(super) shots: usize,
}

impl FewShots<'_> {
    /// Returns the predicted label of each query.
    pub(super) fn answers(
        &self,
        method: TransferMethod,
        queries: &Embedding,
        seed: Seed,
    ) -> Result<Vec<usize>, Cancelled> {
        let Knowledge {
            prior,
            whitening,
            tuned,
            ..
        } = self.knowledge;
        let (support, labels) = (&self.support.hidden, &self.support.labels);
        let largest = |rows: Vec<Vec<f64>>| rows.iter().map(|row| argmax(row)).collect();
        let linear = |support: &Features,
                      queries: &Features,
                      prior: &WeightPrior|
         -> Result<Vec<usize>, Cancelled> {
            let head = LinearHead::fit(support, labels, self.materials, prior)?;
            Ok(largest(head.log_probabilities(queries)))
        };
        let width = support.width();
        Ok(match method {
            TransferMethod::Nk => unreachable!("is trained on sweeps, not on embeddings"),
            TransferMethod::Ol => {
                let prior = WeightPrior::weight_decay(width, self.recipe.training.l2, labels.len());
                linear(support, &queries.hidden, &prior)?
            }
            TransferMethod::OlMean => linear(support, &queries.hidden, prior)?,
            TransferMethod::TunedOl => linear(support, &queries.hidden, tuned.plain(self.shots))?,
            TransferMethod::WhitenedOl => {
                let prior = tuned.whitened(self.shots);
                linear(
                    &whitening.apply(support),
                    &whitening.apply(&queries.hidden),
                    prior,
                )?
            }
            TransferMethod::Lda => {
                let head = NearestMean::fit(&whitening.apply(support), labels, self.materials);
                largest(head.scores(&whitening.apply(&queries.hidden)))
            }
            TransferMethod::Simpleshot => {
                let head = SimpleShot::fit(
                    support,
                    labels,
                    self.materials,
                    self.knowledge.centre.clone(),
                );
                largest(head.scores(&queries.hidden))
            }
            TransferMethod::Nn | TransferMethod::SiameseFull => {
                nearest(support, labels, &queries.hidden)
            }
            TransferMethod::Siamese => self.siamese(queries),
            TransferMethod::OlFcl => self.fine_tuned(queries, seed)?,
        })
    }

    /// Returns the labels of the nearest neighbours after the dense layer that was trained on pairs.
    fn siamese(&self, queries: &Embedding) -> Vec<usize> {
        let layers = self
            .knowledge
            .siamese
            .as_ref()
            .unwrap_or_else(|| panic!("was trained before"));
        let mlp = tactnet_models::Mlp::from_layers(layers, self.device);
        let embed = |embedding: &Embedding| {
            let mut out = mlp.apply(&embedding.convolution);
            out.values_mut().iter_mut().for_each(|v| *v = v.max(0.0));
            out
        };
        nearest(&embed(self.support), &self.support.labels, &embed(queries))
    }

    /// Returns the labels after fine-tuning the dense and the output layer.
    fn fine_tuned(&self, queries: &Embedding, seed: Seed) -> Result<Vec<usize>, Cancelled> {
        let (labels, width) = (&self.support.labels, self.support.hidden.width());
        let batch = self.recipe.training.batch;
        let training = MlpTraining {
            epochs: FINE_TUNING_STEPS.div_ceil(labels.len().div_ceil(batch)),
            batch,
            learning_rate: 3e-4,
            l2: self.recipe.training.l2,
            keep: Some((0, self.recipe.network.keep_probability)),
        };
        let output = DenseWeights {
            weight: vec![0.0; self.materials * width],
            bias: vec![0.0; self.materials],
        };
        let layers = [self.knowledge.classifier.network()?.folded_hidden(), output];
        let mlp = fit_labels(
            &layers,
            &self.support.convolution,
            labels,
            training,
            seed,
            self.device,
        )?;
        let scores = mlp.apply(&queries.convolution);
        let label = |row: &[f32]| argmax(&row.iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
        Ok(scores.rows().map(label).collect())
    }
}

/// Returns the label of the nearest support sweep by Euclidean distance, or of the first of several.
fn nearest(support: &Features, labels: &[usize], queries: &Features) -> Vec<usize> {
    queries
        .rows()
        .map(|query| {
            let distances: Vec<f64> = support
                .rows()
                .map(|row| -squared_distance(row, query))
                .collect();
            labels[argmax(&distances)]
        })
        .collect()
}
