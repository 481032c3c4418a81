//! Network on spectra, evaluated frame by frame.

use std::sync::Arc;

use pulp::{Arch, NullaryFnOnce};

use crate::DenseWeights;
use crate::log_spectra::{LogSpectra, Scratch};
use crate::spectral_trunk::{DEVIATION_EPSILON, SpectralTrunk};

/// Features of the frames so far: mean and deviation over the complete windows; zeros before the first one.
#[derive(Debug, Clone)]
pub(crate) struct SpectralStream {
    spectra: Arc<LogSpectra>,
    taxel: Layer,
    window: Layer,
    taxels: usize,
    /// Frames since the beginning of the next window: `[up to window][taxels]`.
    frames: Vec<f32>,
    /// Number of frames to skip before the next window, if the hop is longer than a window.
    skip: usize,
    scratch: Scratch,
    /// `[taxels][bands + 1]`
    of_spectra: Vec<f32>,
    /// `[taxels][taxel units]`
    of_taxels: Vec<f32>,
    /// `[units]`
    of_window: Vec<f32>,
    /// Number of windows so far; `mean` and `squares` hold each unit's mean and sum of squared deviations (Welford, 1962).
    windows: usize,
    mean: Vec<f64>,
    squares: Vec<f64>,
    /// `[2 x units]`
    features: Vec<f32>,
}

/// Layer `relu(weight x + bias)`.
#[derive(Debug, Clone)]
struct Layer {
    /// `[inputs][outputs]`
    weight: Vec<f32>,
    bias: Vec<f32>,
}

impl Layer {
    fn new(dense: &DenseWeights) -> Self {
        let outputs = dense.bias.len();
        let inputs = dense.weight.len() / outputs;
        let of_input = |input| (0..outputs).map(move |o| dense.weight[o * inputs + input]);
        Self {
            weight: (0..inputs).flat_map(of_input).collect(),
            bias: dense.bias.clone(),
        }
    }

    fn outputs(&self) -> usize {
        self.bias.len()
    }

    /// Computes one row of `outputs` for each row of `inputs`.
    fn apply(&self, inputs: &[f32], outputs: &mut [f32]) {
        Arch::new().dispatch(Apply {
            layer: self,
            inputs,
            outputs,
        });
    }
}

/// See [`Layer::apply`].
struct Apply<'a> {
    layer: &'a Layer,
    inputs: &'a [f32],
    outputs: &'a mut [f32],
}

impl NullaryFnOnce for Apply<'_> {
    type Output = ();

    #[inline(always)]
    fn call(self) {
        let Layer { weight, bias } = self.layer;
        let units = bias.len();
        let rows = self.outputs.chunks_exact_mut(units);
        for (output, input) in rows.zip(self.inputs.chunks_exact(weight.len() / units)) {
            output.copy_from_slice(bias);
            for (x, weights) in input.iter().zip(weight.chunks_exact(units)) {
                for (sum, weight) in output.iter_mut().zip(weights) {
                    *sum = weight.mul_add(*x, *sum);
                }
            }
            output.iter_mut().for_each(|sum| *sum = sum.max(0.0));
        }
    }
}

impl SpectralStream {
    /// Copies the weights of `trunk`.
    pub(crate) fn new(trunk: &SpectralTrunk) -> Self {
        let spectra = Arc::clone(&trunk.spectra);
        let [taxel, window] =
            [&trunk.taxel, &trunk.window].map(|dense| Layer::new(&dense.folded()));
        let taxels = spectra.taxels();
        let units = window.outputs();
        Self {
            frames: Vec::with_capacity(spectra.window() * taxels),
            skip: 0,
            scratch: spectra.scratch(1),
            of_spectra: vec![0.0; taxels * spectra.values()],
            of_taxels: vec![0.0; taxels * taxel.outputs()],
            of_window: vec![0.0; units],
            windows: 0,
            mean: vec![0.0; units],
            squares: vec![0.0; units],
            features: vec![0.0; 2 * units],
            spectra,
            taxel,
            window,
            taxels,
        }
    }

    pub(crate) fn restart(&mut self) {
        self.frames.clear();
        self.skip = 0;
        self.windows = 0;
        self.mean.fill(0.0);
        self.squares.fill(0.0);
        self.features.fill(0.0);
    }

    /// - `frame`: `[taxels]`, normalised
    pub(crate) fn push(&mut self, frame: &[f32]) {
        if self.skip > 0 {
            self.skip -= 1;
            return;
        }
        self.frames.extend_from_slice(frame);
        let window = self.spectra.window();
        if self.frames.len() < window * self.taxels {
            return;
        }
        self.add_window();
        let hop = self.spectra.hop();
        self.skip = hop.saturating_sub(window);
        self.frames.drain(..hop.min(window) * self.taxels);
    }

    fn add_window(&mut self) {
        self.spectra
            .forward(&self.frames, &mut self.of_spectra, &mut self.scratch);
        self.taxel.apply(&self.of_spectra, &mut self.of_taxels);
        self.window.apply(&self.of_taxels, &mut self.of_window);
        self.windows += 1;
        let units = self.of_window.len();
        for (unit, value) in self.of_window.iter().enumerate() {
            let value = f64::from(*value);
            let before = value - self.mean[unit];
            self.mean[unit] += before / self.windows as f64;
            self.squares[unit] += before * (value - self.mean[unit]);
            let variance = self.squares[unit] / self.windows as f64;
            self.features[unit] = self.mean[unit] as f32;
            self.features[units + unit] = (variance + DEVIATION_EPSILON).sqrt() as f32;
        }
    }

    /// Returns the features of the frames so far, `[2 x units]`.
    pub(crate) fn features(&self) -> &[f32] {
        &self.features
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor, TensorData};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use crate::{
        Architecture, InputShape, Network, NetworkConfig, Spectra, StreamingNet, Trunk,
        dropout_masks, values,
    };

    fn config(window: usize, hop: usize, input: InputShape) -> NetworkConfig {
        let trunk = Spectra {
            window: Some(window),
            hop: Some(hop),
            bands: 6,
            taxel_units: 5,
            units: 7,
        };
        let architecture = Architecture {
            trunk: Trunk::Spectra(trunk),
            hidden: 9,
            keep_probability: 0.7,
        };
        NetworkConfig::new(architecture, input, 4).unwrap()
    }

    #[test]
    fn at_any_frame_the_features_are_those_of_a_shorter_sweep() {
        let device = Device::flex();
        // Window, hop, steps, taxels. Cases: usual, gaps between windows, a single window, one taxel.
        for [window, hop, steps, taxels] in [
            [16, 4, 90, 5],
            [8, 11, 70, 16],
            [40, 9, 40, 3],
            [4, 1, 12, 1],
            [4, 1, 4, 1],
        ] {
            let config = config(window, hop, InputShape { steps, taxels });
            let mut rng = ChaCha8Rng::seed_from_u64(7);
            let mut net = Network::init(&config, &device, &mut rng);
            let mut noise = |sweeps: usize| -> Vec<f32> {
                let len = sweeps * steps * taxels;
                (0..len).map(|_| rng.random_range(-2.0..2.0)).collect()
            };
            let batch = TensorData::new(noise(6), [6, 1, steps, taxels]);
            let sweep = noise(1);
            // The statistics differ from those of a new network.
            let mask = dropout_masks(6, config.features(), 0.8, &device, &mut rng);
            let trained = net.forward_train(Tensor::from_data(batch, &device), mask);
            net.update_running_stats(&trained.statistics);

            let mut streaming = StreamingNet::new(&net, &config, &[]);
            for _ in 0..2 {
                streaming.restart();
                for (frame, taxel_values) in sweep.chunks_exact(taxels).enumerate() {
                    streaming.push(taxel_values);
                    let now = frame + 1;
                    let expected = if now < window {
                        vec![0.0; config.features()]
                    } else {
                        let data =
                            TensorData::new(sweep[..now * taxels].to_vec(), [1, 1, now, taxels]);
                        values(net.features(Tensor::from_data(data, &device)))
                    };
                    for (found, expected) in streaming.features().iter().zip(&expected) {
                        assert!((found - expected).abs() < 1e-4, "{now}: {found} {expected}");
                    }
                }
                let features = net.features(Tensor::from_data(
                    TensorData::new(sweep.clone(), [1, 1, steps, taxels]),
                    &device,
                ));
                let expected = values(net.head(features));
                streaming.scores(|scores| {
                    for (found, expected) in scores.iter().zip(&expected) {
                        assert!((found - expected).abs() < 1e-4, "{found} {expected}");
                    }
                });
            }
        }
    }
}
