//! The convolution block of TactNet-II in one operation: convolution, batch normalisation, ReLU and max-pool, forward and backward.
//!
//! ```text
//!            extension            Burn's Flex backend <-> slices, autodiff
//!                v
//!      plans -> block             one planned shape: which way it is computed
//!        ┌───────┼─────────┐
//!     single  spectral   direct   one input map | multiples of eight maps | anything
//!   single_taps one_sweep          the same with AVX-512 | for one sweep with frozen statistics
//!        └───┬───┘
//!    taxel  fft  product          transforms over taxels and time, products of spectra
//!        pooling  norm            winners of every window, batch statistics, what they add to gradients
//!            simd                 vectors of maps
//!        stream  stream_head      the network row by row, for one sweep as it happens
//! ```
//!
//! # Why it is fast
//! - With 15 x 5 kernels a convolution costs 75 products per output and pair of maps. In the frequency domain it is one complex product
//!   per frequency: for layer 2, 0.57 instead of 17.7 GFLOP for 36 sweeps. SAME padding lets a transform of `steps + pad` by `taxels + pad`
//!   points do: what wraps around falls on outputs that are cropped away (`spectral.rs`). The first layer has only one
//!   input map and is cut into tiles of 100 steps (`single.rs`), or computed tap by tap where products are cheap (`single_taps.rs`).
//! - Lanes of a vector are maps, so transforms need no shuffles (`fft.rs`), and the few taxels are transformed by a dense product
//!   that uses the row's symmetry (`taxel.rs`).
//! - One taxel frequency after the other goes through its time spectrum, its products and back while it is in cache.
//! - Pooling and batch statistics are taken while a window's maps are in cache (`pooling.rs`); the first layer's full-resolution maps
//!   are never written.
//! - Backwards, only each window's winner has a gradient; what batch normalisation adds is affine in the maps (`norm.rs`). So the first
//!   layer's weight gradient is a gather at the winners plus the autocorrelation of the input (`single_backward.rs`), and its input
//!   gradient a scatter plus one wider convolution (`single_input.rs`).
//! - One sweep by itself would mostly wait for the weights' spectra: it is transformed over time alone, where they are less than a third
//!   (`one_sweep.rs`).
//! - Spectra of the weights are kept while the weights stay the same (`weight.rs`); buffers and the memory of results are handed out again (`buffers.rs`,
//!   `spare.rs`).
//!
//! Every sum has a fixed order, so results do not depend on the number of threads.

// Kernels walk several register arrays by one index.
#![allow(clippy::needless_range_loop)]

mod block;
mod buffers;
mod butterfly;
mod direct;
mod extension;
mod fft;
mod norm;
mod one_sweep;
mod one_sweep_stages;
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
mod single_taps;
pub(crate) mod spare;
mod spectral;
mod spectral_backward;
mod spectral_plan;
mod spectral_stages;
mod stream;
mod stream_head;
mod taxel;
#[cfg(test)]
mod tests;
#[doc(hidden)]
pub mod timing;
mod weight;

pub use extension::runs_on;
pub(crate) use extension::{TrainedBlock, block_eval, block_train, in_order};
pub use spare::take as spare_memory;
pub(crate) use stream::{StreamBlock, StreamShape};
pub(crate) use stream_head::StreamHead;

pub use block::{Block, ForwardTrain, Gradients, Saved};
pub use shape::BlockShape;
pub use weight::Weight;
