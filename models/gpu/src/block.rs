//! Planned block of a single network.

use std::fmt;

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use tactnet_conv::BlockShape;

use crate::blocks::{self, Blocks};
use crate::networks::{LayerParameters, Stacked, Statistics};

/// Block planned for one shape on one device. All buffers are contiguous 32-bit floats in the order that [`BlockShape`] describes.
pub struct Block {
    client: Client,
    of_one: Blocks,
    /// Number of valid sweeps, which are all sweeps of the batch.
    counts: Stacked,
}

impl fmt::Debug for Block {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Block").field(&self.of_one).finish()
    }
}

/// Result of [`Block::forward_train`].
#[derive(Debug)]
pub struct ForwardTrain {
    /// `[batch, pooled_steps, taxels, maps_out]`
    pub pooled: Handle,
    /// `[maps_out]`: mean of the convolution over batch, steps and taxels.
    pub mean: Handle,
    /// `[maps_out]`: biased variance of the convolution.
    pub variance: Handle,
    /// State for [`Block::backward`].
    pub saved: Saved,
}

/// State of a forward pass for its backward pass.
#[derive(Debug)]
pub struct Saved(blocks::Saved);

/// Gradients of a scalar with respect to the inputs of a block.
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
    /// If a kernel size is even, the pool has no steps, or a dimension is empty.
    pub fn plan(client: &Client, shape: BlockShape) -> Self {
        let sweeps = client.create_from_slice(u32::as_bytes(&[shape.batch as u32]));
        Self {
            client: client.clone(),
            of_one: Blocks::plan(client, shape, 1),
            counts: Stacked::single(&sweeps, 1),
        }
    }

    /// Returns the planned shape.
    pub fn shape(&self) -> &BlockShape {
        &self.of_one.shape
    }

    /// Runs the forward pass with the statistics of this batch.
    pub fn forward_train(
        &self,
        input: &Handle,
        weight: &Handle,
        gamma: &Handle,
        beta: &Handle,
    ) -> ForwardTrain {
        let statistics = Statistics {
            mean: self.per_map(),
            variance: self.per_map(),
        };
        let (pooled, saved) = self.of_one.forward_train(
            &self.client,
            &self.counts,
            &Stacked::single(input, self.shape().input_len()),
            &self.parameters(weight, gamma, beta),
            &statistics,
        );
        ForwardTrain {
            pooled: pooled.buffer.0,
            mean: statistics.mean.buffer.0,
            variance: statistics.variance.buffer.0,
            saved: Saved(saved),
        }
    }

    /// Runs the forward pass with fixed statistics; returns `[batch, pooled_steps, taxels, maps_out]`.
    ///
    /// - `norm`: gamma, beta, mean and variance, `[maps_out]` each
    pub fn forward_eval(&self, input: &Handle, weight: &Handle, norm: [&Handle; 4]) -> Handle {
        let [gamma, beta, mean, variance] = norm;
        let of_maps = |handle| Stacked::single(handle, self.shape().maps_out);
        let statistics = Statistics {
            mean: of_maps(mean),
            variance: of_maps(variance),
        };
        let pooled = self.of_one.forward_eval(
            &self.client,
            &self.counts,
            &Stacked::single(input, self.shape().input_len()),
            &self.parameters(weight, gamma, beta),
            &statistics,
        );
        pooled.buffer.0
    }

    /// Returns the gradients, given the gradient of the pooled output.
    pub fn backward(&self, saved: Saved, gradient: &Handle, need_input: bool) -> Gradients {
        let into = LayerParameters {
            weight: Stacked::floats(&self.client, 1, self.shape().weight_len()),
            gamma: self.per_map(),
            beta: self.per_map(),
        };
        let gradient = Stacked::single(gradient, self.shape().output_len());
        let input = self
            .of_one
            .backward(&self.client, saved.0, &gradient, &into, need_input);
        Gradients {
            weight: into.weight.buffer.0,
            gamma: into.gamma.buffer.0,
            beta: into.beta.buffer.0,
            input: input.map(|input| input.buffer.0),
        }
    }

    fn per_map(&self) -> Stacked {
        Stacked::floats(&self.client, 1, self.shape().maps_out)
    }

    fn parameters(&self, weight: &Handle, gamma: &Handle, beta: &Handle) -> LayerParameters {
        let maps = self.shape().maps_out;
        LayerParameters {
            weight: Stacked::single(weight, self.shape().weight_len()),
            gamma: Stacked::single(gamma, maps),
            beta: Stacked::single(beta, maps),
        }
    }
}
