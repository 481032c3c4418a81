//! The convolution block of TactNet-II in one operation: convolution, batch normalisation, ReLU and max-pool, forward and backward, on
//! plain slices. The README explains the mathematics.
//!
//! ```
//! use tactnet_conv::{Block, BlockShape};
//!
//! let shape = BlockShape { batch: 2, steps: 100, taxels: 16, maps_in: 8, maps_out: 16, kernel: [15, 5], pool: 10 };
//! let block = Block::plan(shape);
//! let (input, weight) = (vec![1.0; shape.input_len()], vec![0.1; shape.weight_len()]);
//! let (gamma, beta) = (vec![1.0; 16], vec![0.0; 16]);
//!
//! let forward = block.forward_train(&input, &weight, &gamma, &beta);
//! assert_eq!(forward.pooled.len(), 2 * 10 * 16 * 16); // [batch, pooled steps, taxels, maps]
//! let gradients = block.backward(forward.saved, &forward.pooled, true);
//! assert_eq!(gradients.weight.len(), shape.weight_len());
//! ```
//!
//! | type | use |
//! |---|---|
//! | [`Block`], [`BlockShape`] | a planned shape: [`Block::forward_train`], [`Block::backward`], [`Block::forward_eval`] |
//! | [`shared_block`] | the same from a process-wide cache of plans |
//! | [`Weight`] | weights whose spectra are kept while they stay the same |
//! | [`StreamBlock`], [`StreamHead`] | the network row by row, for one sweep as it is recorded; nothing allocates |
//! | [`AdamStep`] | one step of the optimiser, in place |
//! | [`Candidate`] | a tiling that the planner weighed, with its predicted time |
//! | [`Isa`] | the instruction set, detected at run time |
//! | [`spare`] | memory of earlier results, for later ones |
//!
//! Slices of a wrong length panic; there are no other errors. Parallel parts run on rayon's current pool. Every sum has a fixed order, so
//! results do not depend on the number of threads.
//!
//! # Files
//! ```text
//!      plans -> block             one planned shape: its route
//!       ┌────────┼─────────┐
//!  first_layer spectral  direct   one input map | multiples of eight maps | anything
//!  first_layer_taps batch_one     the same with AVX-512 | for one sweep with frozen statistics
//!       └────┬───┘
//!        cost  bands             how taxels and steps are cut
//!    taxel  fft  product          transforms over taxels and time, products of spectra
//!        pooling  norm            winners of every window, batch statistics, their part of the gradients
//!            simd                 vectors of maps
//!        stream  stream_head      the network row by row
//!        adam                     the optimiser's step
//! ```

// Kernels walk several register arrays by one index.
#![allow(clippy::needless_range_loop)]

mod adam;
mod bands;
mod batch_one;
mod batch_one_stages;
mod block;
mod buffers;
mod butterfly;
mod cost;
mod direct;
mod fft;
mod first_layer;
mod first_layer_backward;
mod first_layer_input;
mod first_layer_stages;
mod first_layer_taps;
#[cfg(test)]
mod noise;
mod norm;
mod plans;
mod pooling;
mod product;
mod shape;
mod simd;
pub mod spare;
mod spectral;
mod spectral_backward;
mod spectral_plan;
mod spectral_stages;
mod stream;
mod stream_head;
mod taxel;
#[doc(hidden)]
pub mod timing;
mod trim;
mod weight;

pub use adam::AdamStep;
pub use block::{Block, Candidate, ForwardTrain, Gradients, Saved};
pub use buffers::workspace_bytes;
pub use plans::shared_block;
pub use shape::BlockShape;
pub use simd::Isa;
pub use stream::{StreamBlock, StreamShape};
pub use stream_head::StreamHead;
pub use weight::{Identity, Weight};
