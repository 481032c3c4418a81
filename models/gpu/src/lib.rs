//! The block of `tactnet-conv` (convolution, batch normalisation, ReLU, max-pool; forward, backward, gradient of the input) as kernels for
//! GPUs, in 32-bit floats, from one source for Vulkan, Metal, DirectX 12 and CUDA.
//!
//! With few maps coming in, the convolution is one product over the kernel's taps. With more, it goes through spectra over time: Fourier
//! transforms are products with small constant matrices, of any length; for each frequency one product over the kernel's taxels and all
//! maps remains, which takes a seventh of the multiplications of a kernel of 15 steps. All products are one kernel
//! with rules for where entries lie. Results do not depend on the order of execution: no atomics, so runs on one device agree to the bit.

//!
//! [`Block`] is one block of one network. [`Stack`] is the whole training step of several networks at once, each kernel launched once for all of
//! them.

mod adam;
mod block;
mod blocks;
mod device;
mod direct;
mod first_layer;
mod head;
mod matrix;
mod networks;
mod norm;
mod product;
mod spectral;
mod stack;
mod stack_adam;
mod stack_shape;
mod sweeps;
mod tables;

pub use adam::adam_update;
pub use block::{Block, ForwardTrain, Gradients, Saved};
pub use stack::{
    Stack, StackAttack, StackBatch, StackDigits, StackMeasured, StackMethod, StackState,
    StackSweeps,
};
pub use stack_shape::StackShape;
