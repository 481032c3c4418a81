//! A trained network that scores sweeps, plainly or with Monte Carlo dropout.

use std::sync::{Mutex, PoisonError};

use burn::tensor::{Device, Tensor, TensorData};
use tactnet_data::{Seed, SweepView};
use tactnet_models::{
    Features, TactNet, TactNetConfig, Weights, dropout_masks, log_softmax, matrix,
};

use crate::{Embedding, Normalizer, PipelineError, PredictionMethod, TactNetSetup};

/// Sweeps that go through the network at once.
const BATCH: usize = 36;

pub(crate) struct NetworkScorer {
    normalizer: Normalizer,
    network: TactNetConfig,
    net: TactNet,
    device: Device,
    /// Names the masks.
    seed: Seed,
    /// The masks drawn last: they only depend on their number.
    masks: Mutex<Option<(usize, Tensor<2>)>>,
}

impl NetworkScorer {
    /// Puts description and weights together on `device`.
    ///
    /// # Errors
    /// Weights of another network.
    pub fn new(
        setup: &TactNetSetup,
        network: TactNetConfig,
        weights: &Weights,
        device: &Device,
        seed: Seed,
    ) -> Result<Self, PipelineError> {
        let device = device.clone().without_autodiff();
        let net = TactNet::from_weights(&network, weights, &device)?;
        Ok(Self {
            normalizer: setup.normalizer.clone(),
            network,
            net,
            device,
            seed,
            masks: Mutex::new(None),
        })
    }

    /// `[sweeps][materials]`
    pub fn log_probabilities(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Vec<Vec<f64>> {
        let masks = match method {
            PredictionMethod::Plain => None,
            PredictionMethod::McDropout { runs } => Some(self.masks(runs)),
        };
        let positions: Vec<usize> = (0..view.len()).collect();
        let mut rows = Vec::with_capacity(view.len());
        for batch in positions.chunks(BATCH) {
            let features = self.net.features(self.load(view, batch));
            rows.extend(match &masks {
                None => self.plain(features),
                Some(masks) => self.monte_carlo(features, masks),
            });
        }
        rows
    }

    /// What the network makes of every sweep, layer by layer.
    pub fn embed(&self, view: &SweepView<'_>) -> Embedding {
        let positions: Vec<usize> = (0..view.len()).collect();
        let mut layers: [Vec<f32>; 3] = Default::default();
        for batch in positions.chunks(BATCH) {
            let convolution = self.net.features(self.load(view, batch));
            let hidden = self.net.embedding(convolution.clone());
            let logits = self.net.head(convolution.clone());
            for (all, layer) in layers.iter_mut().zip([convolution, hidden, logits]) {
                all.extend(values(layer));
            }
        }
        let [convolution, hidden, logits] = layers;
        Embedding {
            labels: view.labels().collect(),
            convolution: Features::new(self.network.features(), convolution),
            hidden: Features::new(self.network.architecture().hidden, hidden),
            logits: Features::new(self.network.materials(), logits),
        }
    }

    /// How much the dropout masks disagree about every sweep: the mutual information of label and weights, entropy of the mean
    /// minus mean of the entropies, nats (Houlsby et al., 2011; Gal & Ghahramani, 2016).
    pub fn mutual_information(&self, convolution: &Features, runs: usize) -> Vec<f64> {
        let masks = self.masks(runs);
        let materials = self.network.materials();
        let features = matrix(convolution, &self.device);
        (0..convolution.len())
            .map(|sweep| {
                let rows = features.clone().narrow(0, sweep, 1) * masks.clone();
                let scores = values(self.net.head(rows));
                let runs: Vec<Vec<f64>> = scores.chunks(materials).map(log_softmax).collect();
                let own: f64 = runs.iter().map(|run| entropy(run)).sum();
                entropy(&log_mean_exp(&runs)) - own / runs.len() as f64
            })
            .collect()
    }

    /// The trained network.
    pub fn net(&self) -> &TactNet {
        &self.net
    }

    fn load(&self, view: &SweepView<'_>, positions: &[usize]) -> Tensor<4> {
        let shape = view.shape();
        let mut values = vec![0.0; positions.len() * shape.values()];
        view.copy_batch(positions, &mut values);
        self.normalizer.apply(&mut values, shape);
        let extents = [positions.len(), 1, shape.steps, shape.taxels()];
        Tensor::from_data(TensorData::new(values, extents), &self.device)
    }

    /// `[runs, features]`
    fn masks(&self, runs: usize) -> Tensor<2> {
        let mut drawn = self.masks.lock().unwrap_or_else(PoisonError::into_inner);
        match &*drawn {
            Some((known, masks)) if *known == runs => masks.clone(),
            _ => {
                let masks = dropout_masks(
                    runs,
                    self.network.features(),
                    self.network.architecture().keep_probability,
                    &self.device,
                    &mut self.seed.rng("monte carlo dropout"),
                );
                *drawn = Some((runs, masks.clone()));
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

    /// Log of the mean softmax over all masks; the head runs once per sweep, on all masks together.
    fn monte_carlo(&self, features: Tensor<2>, masks: &Tensor<2>) -> Vec<Vec<f64>> {
        let [sweeps, _] = features.dims();
        let materials = self.network.materials();
        (0..sweeps)
            .map(|sweep| {
                let rows = features.clone().narrow(0, sweep, 1) * masks.clone();
                let scores = values(self.net.head(rows));
                let runs: Vec<Vec<f64>> = scores.chunks(materials).map(log_softmax).collect();
                log_mean_exp(&runs)
            })
            .collect()
    }
}

/// Entropy of a distribution, nats.
fn entropy(log_p: &[f64]) -> f64 {
    -log_p
        .iter()
        .map(|l| {
            if *l > f64::NEG_INFINITY {
                l.exp() * l
            } else {
                0.0
            }
        })
        .sum::<f64>()
}

/// `ln(mean over runs of exp)` for each material, normalised; stable however small a probability is.
fn log_mean_exp(runs: &[Vec<f64>]) -> Vec<f64> {
    let mean: Vec<f64> = (0..runs[0].len())
        .map(|material| {
            let column = runs.iter().map(|run| run[material]);
            let largest = column.clone().fold(f64::NEG_INFINITY, f64::max);
            let sum: f64 = column.map(|log_p| (log_p - largest).exp()).sum();
            largest + (sum / runs.len() as f64).ln()
        })
        .collect();
    let total: f64 = mean.iter().map(|log_p| log_p.exp()).sum();
    mean.iter().map(|log_p| log_p - total.ln()).collect()
}

fn values(tensor: Tensor<2>) -> Vec<f32> {
    tensor
        .into_data_as::<f32>()
        .try_into_vec::<f32>()
        .unwrap_or_else(|error| panic!("scores were converted to f32: {error:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_that_agree_tell_nothing_about_the_weights() {
        let sure = log_softmax(&[0.0, 3.0]);
        let unlike = log_softmax(&[3.0, 0.0]);
        let information = |runs: &[Vec<f64>]| {
            let own: f64 = runs.iter().map(|run| entropy(run)).sum();
            entropy(&log_mean_exp(runs)) - own / runs.len() as f64
        };
        assert!(information(&[sure.clone(), sure.clone()]).abs() < 1e-12);
        let apart = information(&[sure.clone(), unlike]);
        assert!((apart - (2.0_f64.ln() - entropy(&sure))).abs() < 1e-12);
        assert!((entropy(&[0.0, f64::NEG_INFINITY])).abs() < 1e-12);
    }

    #[test]
    fn the_mean_over_runs_survives_probabilities_below_f32() {
        let runs = [log_softmax(&[0.0, -300.0]), log_softmax(&[0.0, -310.0])];
        let mean = log_mean_exp(&runs);
        let expected = -300.0 + ((1.0 + (-10.0_f64).exp()) / 2.0).ln();
        assert!((mean[1] - expected).abs() < 1e-9, "{mean:?}");
        let even = log_mean_exp(&[
            vec![0.2_f64.ln(), 0.8_f64.ln()],
            vec![0.6_f64.ln(), 0.4_f64.ln()],
        ]);
        assert!((even[0].exp() - 0.4).abs() < 1e-12 && (even[1].exp() - 0.6).abs() < 1e-12);
    }
}
