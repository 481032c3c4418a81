//! Tensors of several networks with one architecture in a shared buffer.
//!
//! A kernel launched for all networks reads the network's index from its position in the grid. A network's tensor is at a constant
//! stride from the one of the network before.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;

use crate::device::{Buffer, buffer, floats};

/// Location of a tensor of every network in their shared buffer, in 32-bit numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct Place {
    /// Offset of the first network's tensor.
    pub(crate) offset: usize,
    /// Distance from one network's tensor to the next; 0 if all networks share it.
    pub(crate) stride: usize,
}

impl Place {
    /// Returns the location of consecutive tensors of `len` numbers.
    pub(crate) const fn each(len: usize) -> Self {
        Self {
            offset: 0,
            stride: len,
        }
    }

    /// Returns the location for the networks from `first` on.
    pub(crate) const fn from(self, first: usize) -> Self {
        Self {
            offset: self.offset + first * self.stride,
            stride: self.stride,
        }
    }
}

/// Returns the offset of `network`'s tensor.
#[cube]
pub(crate) fn begin(network: usize, #[comptime] place: Place) -> usize {
    network * place.stride + place.offset
}

/// Tensors of all networks.
#[derive(Debug, Clone)]
pub(crate) struct Stacked {
    pub(crate) buffer: Buffer,
    pub(crate) place: Place,
}

impl Stacked {
    /// Allocates uninitialised tensors of `len` numbers each.
    pub(crate) fn floats(client: &Client, networks: usize, len: usize) -> Self {
        Self {
            buffer: floats(client, networks * len),
            place: Place::each(len),
        }
    }

    /// Returns the whole buffer as the tensor of a single network.
    pub(crate) fn single(handle: &Handle, len: usize) -> Self {
        Self {
            buffer: (handle.clone(), len),
            place: Place::each(len),
        }
    }

    /// Returns consecutive tensors of `len` numbers each in `handle`.
    pub(crate) fn each(handle: &Handle, networks: usize, len: usize) -> Self {
        Self {
            buffer: (handle.clone(), networks * len),
            place: Place::each(len),
        }
    }

    /// Returns the tensors that begin `offset` numbers after these.
    pub(crate) fn after(&self, offset: usize) -> Self {
        Self {
            buffer: self.buffer.clone(),
            place: Place {
                offset: self.place.offset + offset,
                stride: self.place.stride,
            },
        }
    }

    /// # Safety
    /// The length must be that of the buffer.
    pub(crate) unsafe fn arg(&self) -> BufferArg {
        // SAFETY: guaranteed by the caller.
        unsafe { buffer(&self.buffer) }
    }
}

/// Parameters of a normalised layer, or buffers for their gradients.
#[derive(Debug, Clone)]
pub(crate) struct LayerParameters {
    /// `[maps_out, maps_in, kernel steps, kernel taxels]` of a block, `[outputs, inputs]` of a dense layer
    pub(crate) weight: Stacked,
    /// `[maps_out]` or `[outputs]`
    pub(crate) gamma: Stacked,
    /// `[maps_out]` or `[outputs]`
    pub(crate) beta: Stacked,
}

/// Statistics of a normalised layer, `[maps_out]` or `[outputs]` each.
#[derive(Debug, Clone)]
pub(crate) struct Statistics {
    pub(crate) mean: Stacked,
    /// Biased variance.
    pub(crate) variance: Stacked,
}
