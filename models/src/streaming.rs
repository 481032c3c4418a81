//! Network evaluated frame by frame.

use tactnet_conv::{StreamHead, StreamLayer};

use crate::conv_stream::ConvStream;
use crate::network::TrunkNet;
use crate::spectral_stream::SpectralStream;
use crate::values::values;
use crate::{DenseWeights, Network, NetworkConfig};

/// Trained network with fixed statistics that receives one sweep frame by frame.
///
/// Each frame does as much of the computation as possible, so little is left after the last one. [`StreamingNet::features`] are those of
/// [`Network::features`] for a sweep of the frames so far, with zeros for pooled steps that have not begun; a network on spectra gives zeros
/// before its first complete window. Only [`StreamingNet::new`] allocates.
#[derive(Debug, Clone)]
pub struct StreamingNet {
    trunk: TrunkStream,
    head: StreamHead,
    steps: usize,
    frames: usize,
}

/// Layers that extract features frame by frame.
#[derive(Debug, Clone)]
enum TrunkStream {
    Convolutions(Box<ConvStream>),
    Spectra(Box<SpectralStream>),
}

impl TrunkStream {
    fn features(&mut self) -> &[f32] {
        match self {
            Self::Convolutions(trunk) => trunk.features(),
            Self::Spectra(trunk) => trunk.features(),
        }
    }
}

impl StreamingNet {
    /// Copies the weights of `net`.
    ///
    /// - `masks`: `[mc_samples][features]`, from [`crate::dropout_masks`]; may be empty
    ///
    /// # Panics
    /// If `config` does not describe `net`, or the masks are not whole rows.
    pub fn new(net: &Network, config: &NetworkConfig, masks: &[f32]) -> Self {
        let input = config.input();
        let features = config.features();
        assert_eq!(masks.len() % features, 0, "masks of {features} features");
        let trunk = match &net.trunk {
            TrunkNet::Convolutions(trunk) => {
                TrunkStream::Convolutions(Box::new(ConvStream::new(trunk, input)))
            }
            TrunkNet::Spectra(trunk) => TrunkStream::Spectra(Box::new(SpectralStream::new(trunk))),
        };
        let hidden = net.hidden.folded();
        let output = DenseWeights {
            weight: values(net.output_weight.val()),
            bias: values(net.output_bias.val()),
        };
        Self {
            trunk,
            head: StreamHead::new(
                StreamLayer {
                    weight: &hidden.weight,
                    bias: &hidden.bias,
                },
                StreamLayer {
                    weight: &output.weight,
                    bias: &output.bias,
                },
                masks,
            ),
            steps: input.steps,
            frames: 0,
        }
    }

    /// Discards the sweep; the next frame starts a new one.
    pub fn restart(&mut self) {
        self.frames = 0;
        match &mut self.trunk {
            TrunkStream::Convolutions(trunk) => trunk.restart(),
            TrunkStream::Spectra(trunk) => trunk.restart(),
        }
    }

    /// Returns the number of frames so far.
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Returns true if the sweep is complete.
    pub fn is_complete(&self) -> bool {
        self.frames == self.steps
    }

    /// Adds the next frame.
    ///
    /// - `frame`: `[taxels]`, normalised
    ///
    /// # Panics
    /// If the sweep is complete.
    pub fn push(&mut self, frame: &[f32]) {
        assert!(!self.is_complete(), "a sweep has {} frames", self.steps);
        self.frames += 1;
        match &mut self.trunk {
            TrunkStream::Convolutions(trunk) => trunk.push(frame),
            TrunkStream::Spectra(trunk) => trunk.push(frame),
        }
    }

    /// Returns the features of the frames so far, in the order of [`Network::features`].
    pub fn features(&mut self) -> &[f32] {
        self.trunk.features()
    }

    /// Calls `visit` with the scores `[materials]` for the frames so far.
    ///
    /// # Panics
    /// If there is no frame yet.
    pub fn scores(&mut self, visit: impl FnMut(&[f32])) {
        assert!(self.frames > 0, "scores need a frame");
        self.head.plain(self.trunk.features(), visit);
    }

    /// Calls `visit` with the scores `[materials]` for the frames so far, once for every dropout mask.
    ///
    /// # Panics
    /// If there is no frame yet.
    pub fn monte_carlo_scores(&mut self, visit: impl FnMut(&[f32])) {
        assert!(self.frames > 0, "scores need a frame");
        self.head.monte_carlo(self.trunk.features(), visit);
    }

    /// Returns the number of dropout masks.
    pub fn mc_samples(&self) -> usize {
        self.head.mc_samples()
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor, TensorData};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::{Architecture, Convolutions, InputShape, Trunk, dropout_masks};

    fn network(steps: usize, taxels: usize, pools: Vec<usize>) -> (Network, NetworkConfig) {
        let trunk = Convolutions {
            maps: vec![5, 9, 6],
            pools: Some(pools),
            ..Convolutions::default()
        };
        let architecture = Architecture {
            trunk: Trunk::Convolutions(trunk),
            hidden: 11,
            ..Architecture::default()
        };
        let config = NetworkConfig::new(architecture, InputShape { steps, taxels }, 4).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut net = Network::init(&config, &Device::flex(), &mut rng);
        // The statistics differ from those of a new network.
        let sweeps = noise(6 * steps * taxels, 8);
        let sweeps = Tensor::from_data(
            TensorData::new(sweeps, [6, 1, steps, taxels]),
            &Device::flex(),
        );
        let mask = dropout_masks(6, config.features(), 0.8, &Device::flex(), &mut rng);
        let trained = net.forward_train(sweeps, mask);
        net.update_running_stats(&trained.statistics);
        (net, config)
    }

    fn noise(len: usize, seed: u64) -> Vec<f32> {
        use rand::RngExt;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..len).map(|_| rng.random_range(-2.0..2.0)).collect()
    }

    fn close(found: &[f32], expected: &[f32]) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
    }

    #[test]
    fn at_any_frame_the_features_are_those_of_a_shorter_sweep() {
        let (steps, taxels) = (173, 5);
        let (net, config) = network(steps, taxels, vec![7, 4, 3]);
        let sweep = noise(steps * taxels, 9);
        let mut streaming = StreamingNet::new(&net, &config, &[]);
        for _ in 0..2 {
            streaming.restart();
            for (frame, taxel_values) in sweep.chunks_exact(taxels).enumerate() {
                streaming.push(taxel_values);
                let now = frame + 1;
                if ![1, 6, 7, 8, 40, 100, 172, 173].contains(&now) {
                    continue;
                }
                let data = TensorData::new(sweep[..now * taxels].to_vec(), [1, 1, now, taxels]);
                let short = net.features(Tensor::from_data(data, &Device::flex()));
                let expected = values(short);
                assert_eq!(expected.len(), config.features());
                // Features of pooled steps that have not begun are zero.
                if now == 1 {
                    assert!(expected.contains(&0.0));
                }
                close(streaming.features(), &expected);
            }
        }
    }

    #[test]
    fn scores_are_those_of_the_network_plainly_and_with_masks() {
        let (steps, taxels) = (100, 16);
        let (net, config) = network(steps, taxels, vec![10, 10, 1]);
        let sweep = noise(steps * taxels, 3);
        let device = Device::flex();
        let masks = dropout_masks(
            5,
            config.features(),
            0.8,
            &device,
            &mut ChaCha8Rng::seed_from_u64(2),
        );
        let mut streaming = StreamingNet::new(&net, &config, &values(masks.clone()));
        sweep
            .chunks_exact(taxels)
            .for_each(|frame| streaming.push(frame));
        assert!(streaming.is_complete() && streaming.mc_samples() == 5);
        let data = TensorData::new(sweep, [1, 1, steps, taxels]);
        let features = net.features(Tensor::from_data(data, &device));
        let (mut plain, mut mc_samples) = (Vec::new(), Vec::new());
        streaming.scores(|scores| plain.extend_from_slice(scores));
        streaming.monte_carlo_scores(|scores| mc_samples.extend_from_slice(scores));
        let before = plain.clone();
        streaming.scores(|scores| plain.copy_from_slice(scores));
        assert_eq!(plain, before, "asked again");
        close(&plain, &values(net.head(features.clone())));
        close(
            &mc_samples,
            &values(net.head(features.repeat_dim(0, 5) * masks)),
        );
    }
}
