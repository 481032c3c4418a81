//! The block of `tactnet-conv` (convolution, batch normalisation, ReLU, max-pool; forward, backward, gradient of the input) as kernels for
//! GPUs, in 32-bit floats, from one source for Vulkan, Metal, DirectX 12 and CUDA.
//!
//! With few maps coming in, the convolution is one product over the kernel's taps. With more, it goes through spectra over time: Fourier
//! transforms are products with small constant matrices, of any length; for each frequency one product over the kernel's taxels and all
//! maps remains, which takes a seventh of the multiplications of a kernel of 15 steps. All products are one kernel
//! with rules for where entries lie. Results do not depend on the order of execution: no atomics, so runs on one device agree to the bit.

mod adam;
mod block;
mod device;
mod direct;
mod first_layer;
mod matrix;
mod norm;
mod product;
mod spectral;
mod tables;

pub use adam::adam_update;
pub use block::{Block, ForwardTrain, Gradients, Saved};
