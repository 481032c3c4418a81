//! One planned block: the route its shape takes, forward and backward.

use std::fmt;

use cubecl::client::Client;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::device::Buffer;
use crate::direct;
use crate::first_layer::FirstLayer;
use crate::norm::{self, Passed};
use crate::spectral::Spectral;

/// Maps that come in from which on products of spectra are fewer than those of taps.
const MIN_SPECTRAL_MAPS: usize = 4;

/// A block planned for one shape on one device. All buffers are 32-bit floats without gaps, in the order that [`BlockShape`] says.
pub struct Block {
    client: Client,
    shape: BlockShape,
    route: Route,
}

impl fmt::Debug for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut found = f.debug_struct("Block");
        found.field("shape", &self.shape);
        found.field("route", &self.route).finish()
    }
}

#[derive(Debug)]
enum Route {
    /// One map in: taps in registers.
    FirstLayer(FirstLayer),
    /// One product over the taps.
    Direct,
    /// Spectra over time, products over taxels and maps for each frequency.
    Spectral(Box<Spectral>),
}

/// Result of [`Block::forward_train`].
#[derive(Debug)]
pub struct ForwardTrain {
    /// `[batch, pooled_steps, taxels, maps_out]`
    pub pooled: Handle,
    /// `[maps_out]`: mean of the convolution over batch, steps and taxels.
    pub mean: Handle,
    /// `[maps_out]`: its biased variance.
    pub variance: Handle,
    /// State for [`Block::backward`].
    pub saved: Saved,
}

/// State that a forward pass leaves for its backward pass.
#[derive(Debug)]
pub struct Saved {
    convolved: Convolved,
    gamma: Handle,
    mean: Handle,
    variance: Handle,
    pooled: Handle,
    winners: Handle,
}

#[derive(Debug)]
struct Convolved {
    out: Handle,
    /// The input, or its spectra.
    input: Buffer,
    /// The weights, or their spectra.
    weight: Buffer,
}

/// Gradients of a scalar with respect to what a block takes.
#[derive(Debug)]
pub struct Gradients {
    /// `[maps_out, maps_in, kernel steps, kernel taxels]`
    pub weight: Handle,
    /// `[maps_out]`
    pub gamma: Handle,
    /// `[maps_out]`
    pub beta: Handle,
    /// `[batch, steps, taxels, maps_in]`, if `need_input` was set.
    pub input: Option<Handle>,
}

impl Block {
    /// Plans a block.
    ///
    /// # Panics
    /// On even kernel sizes, a pool of no step and empty dimensions.
    pub fn plan(client: &Client, shape: BlockShape) -> Self {
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
            client: client.clone(),
            shape,
            route,
        }
    }

    /// The shape that this block was planned for.
    pub fn shape(&self) -> &BlockShape {
        &self.shape
    }

    /// Returns the block with the batch's own statistics.
    pub fn forward_train(
        &self,
        input: &Handle,
        weight: &Handle,
        gamma: &Handle,
        beta: &Handle,
    ) -> ForwardTrain {
        let convolved = self.convolve(input, weight);
        let [mean, variance] = norm::statistics(&self.client, &self.shape, &convolved.out);
        let [pooled, winners] = norm::pool(
            &self.client,
            &self.shape,
            &convolved.out,
            [gamma, beta, &mean, &variance],
        );
        ForwardTrain {
            pooled: pooled.clone(),
            mean: mean.clone(),
            variance: variance.clone(),
            saved: Saved {
                convolved,
                gamma: gamma.clone(),
                mean,
                variance,
                pooled,
                winners,
            },
        }
    }

    /// Returns the block with frozen statistics: `[batch, pooled_steps, taxels, maps_out]`.
    pub fn forward_eval(&self, input: &Handle, weight: &Handle, norm: [&Handle; 4]) -> Handle {
        let convolved = self.convolve(input, weight);
        let [pooled, _] = norm::pool(&self.client, &self.shape, &convolved.out, norm);
        pooled
    }

    /// Returns the gradients from that of the pooled output.
    pub fn backward(&self, saved: Saved, gradient: &Handle, need_input: bool) -> Gradients {
        let passed = Passed {
            gamma: &saved.gamma,
            mean: &saved.mean,
            variance: &saved.variance,
            pooled: &saved.pooled,
            winners: &saved.winners,
            gradient,
        };
        let (client, shape, convolved) = (&self.client, &self.shape, &saved.convolved);
        let found = norm::gradients(client, shape, &convolved.out, &passed);
        let spread = || {
            let handle = norm::spread(client, shape, &convolved.out, &passed, &found);
            (handle, shape.count() * shape.maps_out)
        };
        let Convolved { out, input, weight } = convolved;
        let (weight, input) = match &self.route {
            Route::FirstLayer(layer) => {
                let of_norm = [&found.gamma, &found.beta];
                let of_input =
                    need_input.then(|| direct::input_gradient(client, shape, &spread(), weight));
                let of_weight = layer.weight_gradient(client, &input.0, out, &passed, of_norm);
                (of_weight, of_input)
            }
            Route::Direct => {
                let gradient = spread();
                let of_input =
                    need_input.then(|| direct::input_gradient(client, shape, &gradient, weight));
                let of_weight = direct::weight_gradient(client, shape, input, &gradient);
                (of_weight, of_input)
            }
            Route::Spectral(spectral) => {
                spectral.backward(client, [input, weight], &spread(), need_input)
            }
        };
        Gradients {
            weight,
            gamma: found.gamma,
            beta: found.beta,
            input,
        }
    }

    fn convolve(&self, input: &Handle, weight: &Handle) -> Convolved {
        let (client, shape) = (&self.client, &self.shape);
        let input = (input.clone(), shape.input_len());
        let weight = (weight.clone(), shape.weight_len());
        let out = match &self.route {
            Route::FirstLayer(layer) => layer.convolve(client, &input.0, &weight.0),
            Route::Direct => direct::convolve(client, shape, &input, &weight),
            Route::Spectral(spectral) => {
                let found = spectral.convolve(client, &input, &weight);
                return Convolved {
                    out: found.out,
                    input: found.spectra,
                    weight: found.factors,
                };
            }
        };
        Convolved { out, input, weight }
    }
}
