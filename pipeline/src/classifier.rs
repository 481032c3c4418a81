//! The offline classifier: normaliser, network and label set together.

use std::sync::{Mutex, PoisonError};

use burn::tensor::{Device, Tensor, TensorData};
use serde::{Deserialize, Serialize};
use tactnet_data::{LabelSet, Seed, SweepShape, SweepView};
use tactnet_models::{
    Architecture, InputShape, TactNet, TactNetConfig, Weights, dropout_masks, log_softmax,
};

use crate::{Normalizer, PipelineError, Prediction, PredictionMethod, Predictions, SweepScore};

/// Sweeps that go through the network at once.
const BATCH: usize = 36;

/// Everything about a classifier but its weights; together they rebuild it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClassifierConfig {
    /// Layers.
    pub network: Architecture,
    /// How it predicts unless told otherwise.
    pub prediction: Prediction,
    /// Fitted to the training sweeps.
    pub normalizer: Normalizer,
    /// Materials in label order.
    pub labels: LabelSet,
    /// Shape of every sweep.
    pub shape: SweepShape,
    /// Frames per second of the training sweeps.
    pub sample_rate_hz: f64,
    /// Names the Monte Carlo masks.
    pub seed: Seed,
}

impl ClassifierConfig {
    /// The checked network description.
    ///
    /// # Errors
    /// A setting out of range.
    pub fn network_config(&self) -> Result<TactNetConfig, PipelineError> {
        let input = InputShape {
            steps: self.shape.steps,
            taxels: self.shape.taxels(),
        };
        Ok(TactNetConfig::new(
            self.network.clone(),
            input,
            self.labels.len(),
        )?)
    }
}

/// A trained classifier.
pub struct Classifier {
    config: ClassifierConfig,
    network: TactNetConfig,
    net: TactNet,
    device: Device,
    /// The masks drawn last: they only depend on their number.
    masks: Mutex<Option<(usize, Tensor<2>)>>,
}

impl Classifier {
    /// Puts configuration and weights together on `device`.
    ///
    /// # Errors
    /// Weights of another network.
    pub fn new(
        config: ClassifierConfig,
        weights: &Weights,
        device: &Device,
    ) -> Result<Self, PipelineError> {
        let device = device.clone().without_autodiff();
        let network = config.network_config()?;
        let net = TactNet::from_weights(&network, weights, &device)?;
        Ok(Self {
            config,
            network,
            net,
            device,
            masks: Mutex::new(None),
        })
    }

    /// What it was built from.
    pub fn config(&self) -> &ClassifierConfig {
        &self.config
    }

    /// Scores every sweep of `view`.
    ///
    /// The `runs` Monte Carlo masks are drawn once from the classifier's seed: run `m` stands for the same draw of the
    /// weights for every sweep, so a sweep's score does not depend on its neighbours.
    ///
    /// # Errors
    /// Sweeps of another shape or rate, or other materials.
    pub fn predict(
        &self,
        view: &SweepView<'_>,
        method: PredictionMethod,
    ) -> Result<Predictions, PipelineError> {
        self.check(view)?;
        let masks = match method {
            PredictionMethod::Plain => None,
            PredictionMethod::McDropout { runs } => Some(self.masks(runs)),
        };
        let mut sweeps = Vec::with_capacity(view.len());
        let positions: Vec<usize> = (0..view.len()).collect();
        for batch in positions.chunks(BATCH) {
            let features = self.net.features(self.load(view, batch));
            let rows = match &masks {
                None => self.plain(features),
                Some(masks) => self.monte_carlo(features, masks),
            };
            for (position, log_probability) in batch.iter().zip(rows) {
                sweeps.push(SweepScore {
                    index: view.indices()[*position],
                    label: view.label(*position),
                    log_probability,
                });
            }
        }
        Ok(Predictions {
            labels: self.config.labels.clone(),
            method,
            sweeps,
        })
    }

    fn check(&self, view: &SweepView<'_>) -> Result<(), PipelineError> {
        let ClassifierConfig {
            shape,
            labels,
            sample_rate_hz,
            ..
        } = &self.config;
        let dataset = view.dataset();
        let misfit = |item, expected: String, found: String| {
            Err(PipelineError::Misfit {
                item,
                expected,
                found,
            })
        };
        if view.shape() != *shape {
            return misfit("sweeps", shape.to_string(), view.shape().to_string());
        }
        if (dataset.sample_rate_hz() - sample_rate_hz).abs() > 1e-6 * sample_rate_hz {
            let hz = |rate: f64| format!("{rate} Hz");
            return misfit(
                "sample rate",
                hz(*sample_rate_hz),
                hz(dataset.sample_rate_hz()),
            );
        }
        if dataset.labels() != labels {
            let names = |set: &LabelSet| {
                let shown: Vec<&str> = set.names().take(4).collect();
                format!("{} ({}, …)", set.len(), shown.join(", "))
            };
            return misfit("materials", names(labels), names(dataset.labels()));
        }
        Ok(())
    }

    fn load(&self, view: &SweepView<'_>, positions: &[usize]) -> Tensor<4> {
        let shape = view.shape();
        let mut values = vec![0.0; positions.len() * shape.values()];
        view.copy_batch(positions, &mut values);
        self.config.normalizer.apply(&mut values);
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
                    self.config.network.keep_probability,
                    &self.device,
                    &mut self.config.seed.rng("monte carlo dropout"),
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
