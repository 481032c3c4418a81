//! Values that only the process that made them can use, such as ports.

use std::mem::ManuallyDrop;
use std::sync::Mutex;

use pyo3::prelude::*;

use crate::threads::forked;

/// A value of the process that made it. A forked child neither uses nor drops it: its memory is shared with the parent, and its
/// locks may be held for ever.
pub(crate) struct OfProcess<T> {
    process: u32,
    value: ManuallyDrop<Mutex<T>>,
}

impl<T> OfProcess<T> {
    pub(crate) fn new(value: T) -> Self {
        Self {
            process: std::process::id(),
            value: ManuallyDrop::new(Mutex::new(value)),
        }
    }

    /// Returns the value.
    ///
    /// # Errors
    /// A child process that was forked after the value was made.
    pub(crate) fn here(&self) -> PyResult<&Mutex<T>> {
        if self.process == std::process::id() {
            return Ok(&self.value);
        }
        Err(forked(
            "after this bus, port or hub was opened, and cannot use it; open another one here",
        ))
    }
}

impl<T> Drop for OfProcess<T> {
    fn drop(&mut self) {
        if self.process == std::process::id() {
            // SAFETY: nothing uses the value afterwards.
            unsafe { ManuallyDrop::drop(&mut self.value) }
        }
    }
}
