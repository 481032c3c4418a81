//! Planned block of several networks, forward and backward; each kernel is launched once for all networks.

use cubecl::client::Client;
use tactnet_conv::BlockShape;

use crate::direct;
use crate::first_layer::FirstLayer;
use crate::networks::Stacked;
use crate::norm::{self, Passed, Run};
use crate::spectral::Spectral;

/// Minimum number of input maps for which products of spectra are fewer than products of taps.
const MIN_SPECTRAL_MAPS: usize = 4;

/// Block of `networks` networks, planned for one shape per network on one device.
///
/// All buffers are 32-bit floats, contiguous for each network, in the order that [`BlockShape`] describes.
#[derive(Debug)]
pub(crate) struct Blocks {
    /// Shape of one network's block.
    pub(crate) shape: BlockShape,
    pub(crate) networks: usize,
    route: Route,
}

#[derive(Debug)]
enum Route {
    /// One input map: taps in registers.
    FirstLayer(FirstLayer),
    /// One matrix product over the taps.
    Direct,
    /// Spectra over time, then one product over taxels and maps per frequency.
    Spectral(Box<Spectral>),
}

/// Parameters of a block, or buffers for their gradients.
#[derive(Debug, Clone)]
pub(crate) struct Learnt {
    /// `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub(crate) weight: Stacked,
    /// `[maps_out]`
    pub(crate) gamma: Stacked,
    /// `[maps_out]`
    pub(crate) beta: Stacked,
}

/// State of a forward pass for its backward pass.
#[derive(Debug)]
pub(crate) struct Saved {
    convolved: Convolved,
    gamma: Stacked,
    mean: Stacked,
    variance: Stacked,
    pooled: Stacked,
    winners: Stacked,
    counts: Stacked,
}

#[derive(Debug)]
struct Convolved {
    out: Stacked,
    /// Input or its spectra.
    input: Stacked,
    /// Weights or their spectra.
    weight: Stacked,
}

impl Blocks {
    /// Plans a block.
    ///
    /// # Panics
    /// If a kernel size is even, the pool has no steps, or a dimension is empty.
    pub(crate) fn plan(client: &Client, shape: BlockShape, networks: usize) -> Self {
        assert!(
            shape.kernel.iter().all(|k| k % 2 == 1) && shape.pool > 0 && shape.output_len() > 0,
            "a block needs odd kernel sizes, a pool of at least one step and no empty dimension, found {shape:?}"
        );
        let route = if let Some(first_layer) = FirstLayer::of(&shape) {
            Route::FirstLayer(first_layer)
        } else if shape.maps_in < MIN_SPECTRAL_MAPS {
            Route::Direct
        } else {
            Route::Spectral(Box::new(Spectral::of(client, &shape)))
        };
        Self {
            shape,
            networks,
            route,
        }
    }

    fn run<'a>(&'a self, client: &'a Client, counts: &'a Stacked) -> Run<'a> {
        Run {
            client,
            shape: &self.shape,
            networks: self.networks,
            counts,
        }
    }

    /// Runs the forward pass with each network's batch statistics; returns `[batch, pooled_steps, taxels, maps_out]`.
    ///
    /// - `counts`: number of valid sweeps of each network, without padding sweeps, `[1]` each
    /// - `statistics`: target of mean and biased variance, `[maps_out]` each
    pub(crate) fn forward_train(
        &self,
        client: &Client,
        counts: &Stacked,
        input: &Stacked,
        learnt: &Learnt,
        statistics: [&Stacked; 2],
    ) -> (Stacked, Saved) {
        let run = self.run(client, counts);
        let convolved = self.convolve(&run, input, &learnt.weight);
        norm::statistics(&run, &convolved.out, statistics);
        let [mean, variance] = statistics;
        let [pooled, winners] = norm::pool(
            &run,
            &convolved.out,
            [&learnt.gamma, &learnt.beta, mean, variance],
        );
        let saved = Saved {
            convolved,
            gamma: learnt.gamma.clone(),
            mean: mean.clone(),
            variance: variance.clone(),
            pooled: pooled.clone(),
            winners,
            counts: counts.clone(),
        };
        (pooled, saved)
    }

    /// Runs the forward pass with fixed statistics `[mean, variance]`.
    pub(crate) fn forward_eval(
        &self,
        client: &Client,
        counts: &Stacked,
        input: &Stacked,
        learnt: &Learnt,
        [mean, variance]: [&Stacked; 2],
    ) -> Stacked {
        let run = self.run(client, counts);
        let convolved = self.convolve(&run, input, &learnt.weight);
        let norm = [&learnt.gamma, &learnt.beta, mean, variance];
        let [pooled, _] = norm::pool(&run, &convolved.out, norm);
        pooled
    }

    /// Writes the parameters' gradients to `into`, given the gradient of the pooled output; returns the input's gradient if requested.
    pub(crate) fn backward(
        &self,
        client: &Client,
        saved: Saved,
        gradient: &Stacked,
        into: &Learnt,
        need_input: bool,
    ) -> Option<Stacked> {
        let run = self.run(client, &saved.counts);
        let Convolved { out, input, weight } = &saved.convolved;
        let passed = Passed {
            convolved: out,
            gamma: &saved.gamma,
            mean: &saved.mean,
            variance: &saved.variance,
            pooled: &saved.pooled,
            winners: &saved.winners,
            gradient,
            of_gamma: &into.gamma,
            of_beta: &into.beta,
        };
        norm::gradients(&run, &passed);
        match &self.route {
            Route::FirstLayer(layer) => {
                let of_input = need_input
                    .then(|| direct::input_gradient(&run, &norm::spread(&run, &passed), weight));
                layer.weight_gradient(&run, input, &passed, &into.weight);
                of_input
            }
            Route::Direct => {
                let gradient = norm::spread(&run, &passed);
                let of_input = need_input.then(|| direct::input_gradient(&run, &gradient, weight));
                direct::weight_gradient(&run, input, &gradient, &into.weight);
                of_input
            }
            Route::Spectral(spectral) => {
                let gradient = norm::spread(&run, &passed);
                spectral.backward(&run, [input, weight], &gradient, &into.weight, need_input)
            }
        }
    }

    fn convolve(&self, run: &Run<'_>, input: &Stacked, weight: &Stacked) -> Convolved {
        let out = match &self.route {
            Route::FirstLayer(layer) => layer.convolve(run, input, weight),
            Route::Direct => direct::convolve(run, input, weight),
            Route::Spectral(spectral) => {
                let found = spectral.convolve(run, input, weight);
                return Convolved {
                    out: found.out,
                    input: found.spectra,
                    weight: found.factors,
                };
            }
        };
        Convolved {
            out,
            input: input.clone(),
            weight: weight.clone(),
        }
    }
}
