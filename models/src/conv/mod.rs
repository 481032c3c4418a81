//! The convolution block of TactNet-II on plain slices: convolution, batch normalisation, ReLU and max-pool in one,
//! forward and backward.

// Kernels walk several register arrays by one index.
#![allow(clippy::needless_range_loop)]

mod block;
mod buffers;
mod butterfly;
mod direct;
mod extension;
mod fft;
mod norm;
mod plans;
mod pooling;
mod product;
#[cfg(test)]
mod reference;
mod shape;
mod simd;
mod single;
mod single_backward;
mod single_input;
mod single_stages;
mod spectral;
mod spectral_backward;
mod spectral_plan;
mod spectral_stages;
mod taxel;
#[cfg(test)]
mod tests;
mod weight;

pub use extension::runs_on;
pub(crate) use extension::{TrainedBlock, block_eval, block_train};

pub use block::{Block, Gradients, Saved, Trained};
pub use shape::BlockShape;
pub use weight::Weight;
