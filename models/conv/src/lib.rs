//! Convolution block of TactNet-II on plain slices: convolution, batch normalisation, ReLU and max-pool, forward and backward, in one
//! operation. The README explains the mathematics.
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
//! | [`Block`], [`BlockShape`] | planned block: [`Block::forward_train`], [`Block::backward`], [`Block::forward_eval`] |
//! | [`shared_block`] | block from a process-wide cache of plans |
//! | [`Weight`] | weights whose spectra are cached while they do not change |
//! | [`StreamBlock`], [`StreamHead`] | network row by row, for a sweep during recording, without allocation |
//! | [`AdamStep`] | in-place optimiser step |
//! | [`Candidate`] | tiling that the planner considered, with its predicted time |
//! | [`Isa`] | instruction set, detected at run time |
//! | [`spare`] | memory of earlier results for later ones |
//!
//! Slices of a wrong length panic; other errors do not occur. Parallel parts run on rayon's current pool. Every sum has a fixed order, so
//! results do not depend on the number of threads.
//!
//! # Files
//! ```text
//!      plans -> block             planned block and its route
//!       ┌────────┼─────────┐
//!  first_layer spectral  direct   one input map | multiples of eight maps | any shape
//!            batch_one           single sweep with fixed statistics
//!       └────┬───┘
//!        cost  bands             division of taxels and steps
//!    taxel  fft  product          transforms over taxels and time, products of spectra
//!        pooling  norm            winners of every window, batch statistics and their part of the gradients
//!            simd                 vectors of maps
//!        stream  stream_head      network row by row
//!        adam                     optimiser step
//! ```

// Kernels index several register arrays with one variable.
#![allow(clippy::needless_range_loop)]

mod adam;
mod bands;
mod batch_one;
mod block;
mod buffers;
mod butterfly;
mod cost;
mod direct;
mod fft;
mod first_layer;
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
mod stream;
mod stream_head;
mod taxel;
#[doc(hidden)]
pub mod timing;
mod trim;
mod weight;

pub use adam::AdamStep;
pub use block::{Block, Candidate, ForwardTrain, Gradients, Saved};
pub use plans::shared_block;
pub use shape::BlockShape;
pub use simd::Isa;
pub use stream::{StreamBlock, StreamShape};
pub use stream_head::{StreamHead, StreamLayer};
pub use weight::{Identity, Weight};
