//! Packet that is being written.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

use crate::Packet;
use crate::transport::{AnyLoan, both};

/// A packet that is being written: a slice of items in shared memory. If dropped, it is not sent.
#[derive(Debug)]
pub struct Loan<T> {
    pub(crate) sample: AnyLoan,
    pub(crate) items: usize,
    /// Number of the put-port that loaned it.
    pub(crate) sender: u64,
    pub(crate) items_of: PhantomData<T>,
}

impl<T: Packet> Deref for Loan<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        let first = both!(&self.sample, sample => sample.payload().as_ptr());
        // SAFETY: the blocks hold at least `items` items, are aligned to 64 bytes, and every bit pattern is a `T`.
        unsafe { std::slice::from_raw_parts(first.cast::<T>(), self.items) }
    }
}

impl<T: Packet> DerefMut for Loan<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        let first = both!(&mut self.sample, sample => sample.payload_mut().as_mut_ptr());
        // SAFETY: as above; the packet has a single owner until it is put.
        unsafe { std::slice::from_raw_parts_mut(first.cast::<T>(), self.items) }
    }
}
