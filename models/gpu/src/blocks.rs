//! Planned block of several networks, forward and backward; each kernel is launched once for all networks.

use cubecl::client::Client;
use tactnet_conv::BlockShape;

use crate::direct;
use crate::first_layer::FirstLayer;
use crate::networks::{LayerParameters, Stacked, Statistics};
use crate::norm::{self, PassedBlock, Run};
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

/// State of a forward pass for its backward pass.
#[derive(Debug)]
pub(crate) struct Saved {
    convolved: Convolved,
    gamma: Stacked,
    statistics: Statistics,
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
    /// - `statistics`: target of mean and variance
    pub(crate) fn forward_train(
        &self,
        client: &Client,
        counts: &Stacked,
        input: &Stacked,
        parameters: &LayerParameters,
        statistics: &Statistics,
    ) -> (Stacked, Saved) {
        let run = self.run(client, counts);
        let convolved = self.convolve(&run, input, &parameters.weight);
        norm::statistics(&run, &convolved.out, statistics);
        let [pooled, winners] = norm::pool(&run, &convolved.out, parameters, statistics);
        let saved = Saved {
            convolved,
            gamma: parameters.gamma.clone(),
            statistics: statistics.clone(),
            pooled: pooled.clone(),
            winners,
            counts: counts.clone(),
        };
        (pooled, saved)
    }

    /// Runs the forward pass with fixed statistics.
    pub(crate) fn forward_eval(
        &self,
        client: &Client,
        counts: &Stacked,
        input: &Stacked,
        parameters: &LayerParameters,
        statistics: &Statistics,
    ) -> Stacked {
        let run = self.run(client, counts);
        let convolved = self.convolve(&run, input, &parameters.weight);
        let [pooled, _] = norm::pool(&run, &convolved.out, parameters, statistics);
        pooled
    }

    /// Writes the parameters' gradients to `into`, given the gradient of the pooled output; returns the input's gradient if requested.
    pub(crate) fn backward(
        &self,
        client: &Client,
        saved: Saved,
        gradient: &Stacked,
        into: &LayerParameters,
        need_input: bool,
    ) -> Option<Stacked> {
        let run = self.run(client, &saved.counts);
        let Convolved { out, input, weight } = &saved.convolved;
        let passed = PassedBlock {
            convolved: out,
            gamma: &saved.gamma,
            statistics: &saved.statistics,
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
                spectral.backward(&run, input, weight, &gradient, &into.weight, need_input)
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
