//! Trained network that scores sweeps, plainly or with Monte Carlo dropout.

use std::sync::{Mutex, PoisonError};

use burn::tensor::{Device, Tensor, TensorData};
use rayon::prelude::*;
use tactnet_data::{Seed, SweepView};
use tactnet_models::{
    Features, Network, NetworkConfig, StreamingNet, Weights, dropout_masks, log_mean_exp_into,
    log_softmax, log_softmax_into, matrix, mutual_information, spare_memory, values,
};

use crate::network::in_pool::in_pool;
use crate::{DeadTaxels, Embedding, NetworkSetup, Normalizer, PipelineError, PredictionMethod};

/// Maximum number of values in all dropout masks together: one GiB of `f32`.
const MASK_NUMBERS: usize = 1 << 28;
/// Number of sweeps in a forward pass.
const BATCH: usize = 36;

pub(crate) struct NetworkScorer {
    normalizer: Normalizer,
    /// Readings of dead taxels; zero after scaling.
    dead: DeadTaxels,
    network: NetworkConfig,
    net: Network,
    device: Device,
    /// Seed of the masks.
    seed: Seed,
    /// Last masks with their number, which alone determines them.
    masks: Mutex<Option<(usize, Tensor<2>)>>,
}

impl NetworkScorer {
    /// Builds the network on `device` from its description and weights.
    ///
    /// # Errors
    /// Weights of another network.
    pub fn new(
        setup: &NetworkSetup,
        network: NetworkConfig,
        weights: &Weights,
        device: &Device,
        seed: Seed,
    ) -> Result<Self, PipelineError> {
        let device = device.clone().without_autodiff();
        let net = Network::from_weights(&network, weights, &device)?;
        Ok(Self {
            normalizer: setup.normalizer.clone(),
            dead: DeadTaxels::default(),
            network,
            net,
            device,
            seed,
            masks: Mutex::new(None),
        })
    }

    /// Masks these taxels: their scaled values become zero, as those of dropped taxels in training.
    pub fn mask(&mut self, dead: &[usize]) {
        let offset = self.normalizer.offset();
        self.dead = DeadTaxels(dead.iter().map(|&taxel| (taxel, offset[taxel])).collect());
    }

    /// Returns the masked taxels with their readings.
    pub fn dead(&self) -> &DeadTaxels {
        &self.dead
    }

    /// Returns log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Vec<Vec<f64>> {
        in_pool(&self.device, || self.score(view, method))
    }

    fn score(&self, view: &SweepView<'_>, method: PredictionMethod) -> Vec<Vec<f64>> {
        let masks = match method {
            PredictionMethod::Plain => None,
            PredictionMethod::McDropout { mc_samples } => Some(self.masks(mc_samples)),
        };
        let mut rows = vec![Vec::new(); view.len()];
        for (positions, part) in view.by_length() {
            let places: Vec<usize> = (0..part.len()).collect();
            for batch in places.chunks(BATCH) {
                let features = self.net.features(self.load(&part, batch));
                let scored = match &masks {
                    None => self.plain(features),
                    Some(masks) => self.monte_carlo(features, masks),
                };
                for (place, row) in batch.iter().zip(scored) {
                    rows[positions[*place]] = row;
                }
            }
        }
        rows
    }

    /// Returns the outputs of every layer for every sweep.
    pub fn embed(&self, view: &SweepView<'_>) -> Embedding {
        let widths = [
            self.network.features(),
            self.network.architecture().hidden,
            self.network.materials(),
        ];
        let mut layers = widths.map(|width| Features::new(width, vec![0.0; view.len() * width]));
        for (positions, part) in view.by_length() {
            let places: Vec<usize> = (0..part.len()).collect();
            for batch in places.chunks(BATCH) {
                let convolution = self.net.features(self.load(&part, batch));
                let hidden = self.net.embedding(convolution.clone());
                let logits = self.net.head(convolution.clone());
                for (all, layer) in layers.iter_mut().zip([convolution, hidden, logits]) {
                    let rows = Features::new(all.width(), values(layer));
                    for (place, row) in batch.iter().zip(rows.rows()) {
                        all.row_mut(positions[*place]).copy_from_slice(row);
                    }
                }
            }
        }
        let [convolution, hidden, logits] = layers;
        Embedding {
            labels: view.labels().collect(),
            convolution,
            hidden,
            logits,
        }
    }

    /// Returns the disagreement of the dropout masks about every sweep, in nats; see [`mutual_information`].
    pub fn mutual_information(&self, convolution: &Features, mc_samples: usize) -> Vec<f64> {
        let masks = self.masks(mc_samples);
        let mut mean = vec![0.0; self.network.materials()];
        let features = matrix(convolution, &self.device);
        (0..convolution.len())
            .map(|sweep| {
                let mc_samples = self.run_log_probabilities(&features, sweep, &masks);
                log_mean_exp_into(&mc_samples, &mut mean);
                mutual_information(&mc_samples, &mean)
            })
            .collect()
    }

    /// Returns the network in the form that takes one frame at a time, with `mc_samples` masks.
    pub fn streaming(&self, mc_samples: usize) -> StreamingNet {
        let masks = match mc_samples {
            0 => Vec::new(),
            mc_samples => values(self.masks(mc_samples)),
        };
        StreamingNet::new(&self.net, &self.network, &masks)
    }

    /// Returns the masks of a Monte Carlo prediction for other runtimes, `[mc_samples][features]`.
    pub fn mask_values(&self, mc_samples: usize) -> Vec<f32> {
        values(self.masks(mc_samples))
    }

    /// Returns the normaliser of the network's input.
    pub fn normalizer(&self) -> &Normalizer {
        &self.normalizer
    }

    /// Succeeds if that number of dropout masks fits into one GiB.
    ///
    /// # Errors
    /// Too many masks.
    pub fn check_masks(&self, mc_samples: usize) -> Result<(), PipelineError> {
        let most = MASK_NUMBERS / self.network.features().max(1);
        if mc_samples <= most {
            return Ok(());
        }
        Err(PipelineError::Spec {
            setting: "mc",
            expected: format!("at most {most} dropout masks of this network"),
            found: mc_samples.to_string(),
        })
    }

    /// Returns the compute device.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Returns the trained network.
    pub fn net(&self) -> &Network {
        &self.net
    }

    /// Returns scaled sweeps, `[sweeps, 1, steps, taxels]`.
    pub(crate) fn load(&self, view: &SweepView<'_>, positions: &[usize]) -> Tensor<4> {
        let shape = view.shape();
        let mut values = spare_memory(positions.len() * shape.values());
        values
            .par_chunks_exact_mut(shape.values())
            .zip(positions)
            .for_each(|(sweep, &position)| {
                view.copy_batch(&[position], sweep);
                self.dead.apply(sweep, shape.taxels());
                self.normalizer.apply(sweep, shape);
            });
        let extents = [positions.len(), 1, shape.steps, shape.taxels()];
        Tensor::from_data(TensorData::new(values, extents), &self.device)
    }

    /// Returns dropout masks `[mc_samples, features]`.
    pub(crate) fn masks(&self, mc_samples: usize) -> Tensor<2> {
        let mut drawn = self.masks.lock().unwrap_or_else(PoisonError::into_inner);
        match &*drawn {
            Some((known, masks)) if *known == mc_samples => masks.clone(),
            _ => {
                let masks = dropout_masks(
                    mc_samples,
                    self.network.features(),
                    self.network.architecture().keep_probability,
                    &self.device,
                    &mut self.seed.rng("monte carlo dropout"),
                );
                *drawn = Some((mc_samples, masks.clone()));
                masks
            }
        }
    }

    fn plain(&self, features: Tensor<2>) -> Vec<Vec<f64>> {
        let materials = self.network.materials();
        values(self.net.head(features))
            .chunks(materials)
            .map(log_softmax)
            .collect()
    }

    /// Returns the logarithm of the mean softmax over all masks. The head runs once per sweep, on all masks together.
    fn monte_carlo(&self, features: Tensor<2>, masks: &Tensor<2>) -> Vec<Vec<f64>> {
        let [sweeps, _] = features.dims();
        (0..sweeps)
            .map(|sweep| {
                let mut mean = vec![0.0; self.network.materials()];
                let mc_samples = self.run_log_probabilities(&features, sweep, masks);
                log_mean_exp_into(&mc_samples, &mut mean);
                mean
            })
            .collect()
    }

    /// Returns log-probabilities of one sweep, `[mc_samples][materials]`.
    fn run_log_probabilities(
        &self,
        features: &Tensor<2>,
        sweep: usize,
        masks: &Tensor<2>,
    ) -> Vec<f64> {
        let materials = self.network.materials();
        let rows = features.clone().narrow(0, sweep, 1) * masks.clone();
        let scores = values(self.net.head(rows));
        let mut mc_samples = vec![0.0; scores.len()];
        for (sample, scores) in mc_samples
            .chunks_mut(materials)
            .zip(scores.chunks(materials))
        {
            log_softmax_into(scores, sample);
        }
        mc_samples
    }
}

#[cfg(test)]
mod tests {
    use tactnet_data::twin;
    use tactnet_data::{Fold, Scheme};
    use tactnet_models::Compute;

    use super::*;
    use crate::{Classifier, NetworkRecipe, train_network};

    #[test]
    fn samples_have_masks_of_their_own_which_keep_the_stated_share() {
        let twin = twin::small(3, 10, 60).unwrap();
        let fold = Fold::new(&twin, Scheme::default(), Seed(1), 0, 0).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let trained = |keep: f64| {
            let text = format!(
                "name = \"small\"\nnetwork = {{ maps = [3, 8], hidden = 8, keep_probability = {keep} }}\n\
                 [training]\nepochs = 1\nbatch = 8\nlearning_rate = 0.01\nmethod = {{ kind = \"base\" }}\n"
            );
            let recipe = NetworkRecipe::parse("small", &text).unwrap();
            train_network(&recipe, &fold.train, Seed(1), &device, |_| true)
                .unwrap()
                .unwrap()
        };
        let classifier = trained(0.8);
        let masks = classifier.masks(50).unwrap();
        let rows: Vec<&[f32]> = masks.chunks_exact(masks.len() / 50).collect();
        for (index, row) in rows.iter().enumerate() {
            assert!(!rows[..index].contains(row), "{index}");
        }
        let kept = masks.iter().filter(|v| **v != 0.0).count() as f64 / masks.len() as f64;
        // Five standard errors of a share.
        let error = 5.0 * (0.8 * 0.2 / masks.len() as f64).sqrt();
        assert!((kept - 0.8).abs() < error, "{kept}");

        let scores = |classifier: &Classifier, method| {
            let predictions = classifier.predict(&fold.test, method).unwrap();
            let rows = predictions.sweeps.into_iter();
            rows.map(|s| s.log_probability).collect::<Vec<_>>()
        };
        let dropout = PredictionMethod::McDropout { mc_samples: 3 };
        assert_ne!(
            scores(&classifier, dropout),
            scores(&classifier, PredictionMethod::Plain)
        );
        let all_kept = trained(1.0);
        let plain = scores(&all_kept, PredictionMethod::Plain);
        for (found, expected) in scores(&all_kept, dropout).iter().zip(&plain) {
            for (found, expected) in found.iter().zip(expected) {
                // The head adds in another order.
                assert!((found - expected).abs() < 1e-5, "{found} {expected}");
            }
        }
    }
}
