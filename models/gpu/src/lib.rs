//! GPU kernels for the block of `tactnet-conv`: convolution, batch normalisation, ReLU and max-pool, forward and backward.
//!
//! They compute in 32-bit floats. One source serves Vulkan, Metal, DirectX 12 and CUDA.
//!
//! With few input maps, the convolution is one product over the kernel's taps. With more, it uses spectra over time: Fourier transforms
//! of any length are products with small constant matrices, and each frequency needs one product over the kernel's taxels and all
//! maps. That takes a seventh of the multiplications for a kernel of 15 steps. All products share one kernel with rules for the
//! location of entries. No kernel uses atomics, so results do not depend on the order of execution, and runs on one device are equal to the bit.
//!
//! [`Block`] is one block of one network. [`Stack`] is the whole training step of several networks; each kernel is launched once for all.

mod adam;
mod block;
mod blocks;
mod dense;
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
mod stack_data;
mod stack_shape;
mod sweeps;
mod tables;

pub use adam::adam_update;
pub use block::{Block, ForwardTrain, Gradients, Saved};
pub use stack::Stack;
pub use stack_data::{
    StackAttack, StackBatch, StackDigits, StackMeasured, StackMethod, StackState, StackSweeps,
};
pub use stack_shape::StackShape;
