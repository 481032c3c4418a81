//! Tensors of several networks of one architecture, in one buffer each.
//!
//! A kernel that is launched once for all networks takes the network from its place in the grid; what is the network's own lies at a distance
//! from what is the first one's.

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;

use crate::device::{Buffer, buffer, floats};

/// Where a tensor of each network lies in the buffer that holds it of all, in 32-bit numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub(crate) struct Place {
    /// Of the first network.
    pub(crate) offset: usize,
    /// From one network to the next; 0 where all have the same.
    pub(crate) stride: usize,
}

impl Place {
    /// One network's tensor of `len` numbers after the other's.
    pub(crate) const fn each(len: usize) -> Self {
        Self {
            offset: 0,
            stride: len,
        }
    }

    /// The same for the networks from `first` on.
    pub(crate) const fn from(self, first: usize) -> Self {
        Self {
            offset: self.offset + first * self.stride,
            stride: self.stride,
        }
    }
}

/// Where the tensor of `network` begins.
#[cube]
pub(crate) fn begin(network: usize, #[comptime] place: Place) -> usize {
    network * place.stride + place.offset
}

/// A tensor of each network.
#[derive(Debug, Clone)]
pub(crate) struct Stacked {
    pub(crate) buffer: Buffer,
    pub(crate) place: Place,
}

impl Stacked {
    /// A buffer for tensors of `len` numbers each, not set.
    pub(crate) fn floats(client: &Client, networks: usize, len: usize) -> Self {
        Self {
            buffer: floats(client, networks * len),
            place: Place::each(len),
        }
    }

    /// The whole buffer as the tensor of a single network.
    pub(crate) fn single(handle: &Handle, len: usize) -> Self {
        Self {
            buffer: (handle.clone(), len),
            place: Place::each(len),
        }
    }

    /// Tensors of `len` numbers each that lie one after the other in `handle`.
    pub(crate) fn each(handle: &Handle, networks: usize, len: usize) -> Self {
        Self {
            buffer: (handle.clone(), networks * len),
            place: Place::each(len),
        }
    }

    /// What lies `offset` numbers after the beginning of each.
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
    /// The length must be the buffer's.
    pub(crate) unsafe fn arg(&self) -> BufferArg {
        // SAFETY: as the caller promises.
        unsafe { buffer(&self.buffer) }
    }
}
