//! Thread pool of the package. A forked child process gets a separate pool.

use std::ptr;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::TactnetError;

/// Stack of a thread, as large as that of a main thread, in bytes.
const STACK_BYTES: usize = 8 << 20;

/// Pool of the newest process; null before the first use.
static POOL: AtomicPtr<Pool> = AtomicPtr::new(ptr::null_mut());

/// A thread pool, and the process that has its threads.
struct Pool {
    process: u32,
    threads: ThreadPool,
    /// Number of operations that run in it.
    active: AtomicUsize,
}

/// An operation in the thread pool.
pub(crate) struct Operation(&'static Pool);

impl Operation {
    /// Begins an operation.
    ///
    /// # Errors
    /// A process that was forked during an operation.
    pub(crate) fn begin() -> PyResult<Self> {
        let pool = Pool::of_this_process()?;
        pool.active.fetch_add(1, Ordering::SeqCst);
        Ok(Self(pool))
    }

    /// Runs `work` on a thread of the pool. It must not lock anything that `work` of another operation locks: a thread of the pool that waits
    /// may run both.
    pub(crate) fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        self.0.threads.install(work)
    }
}

impl Drop for Operation {
    fn drop(&mut self) {
        self.0.active.fetch_sub(1, Ordering::SeqCst);
    }
}

impl Pool {
    /// Returns the pool of this process, and starts it if it is missing.
    ///
    /// # Errors
    /// A process that was forked during an operation, whose locks are never released; threads that cannot be started.
    fn of_this_process() -> PyResult<&'static Self> {
        let process = std::process::id();
        let found = POOL.load(Ordering::SeqCst);
        // SAFETY: a pool is never freed.
        if let Some(pool) = unsafe { found.as_ref() } {
            if pool.process == process {
                return Ok(pool);
            }
            if pool.active.load(Ordering::SeqCst) > 0 {
                return Err(forked("while another thread used tactnet"));
            }
        }
        let threads = ThreadPoolBuilder::new()
            .stack_size(STACK_BYTES)
            .build()
            .map_err(|error| TactnetError::new_err(error.to_string()))?;
        let new = Box::into_raw(Box::new(Self {
            process,
            threads,
            active: AtomicUsize::new(0),
        }));
        let stored = POOL.compare_exchange(found, new, Ordering::SeqCst, Ordering::SeqCst);
        // Another thread may have stored its pool first. The one of a parent process has no threads here and is left alone.
        let pool = stored.map_or_else(|first| first, |_| new);
        // SAFETY: as above.
        Ok(unsafe { &*pool })
    }
}

/// Runs `work` in the thread pool without the interpreter lock.
///
/// # Errors
/// A process that was forked during an operation.
pub(crate) fn detached<R: Send>(py: Python<'_>, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    let operation = Operation::begin()?;
    Ok(py.detach(|| operation.install(work)))
}

/// Runs `work` on a locked value in the thread pool without the interpreter lock.
///
/// # Errors
/// A process that was forked during an operation.
pub(crate) fn detached_with<T: Send, R: Send>(
    py: Python<'_>,
    value: &Mutex<T>,
    work: impl FnOnce(&mut T) -> R + Send,
) -> PyResult<R> {
    let operation = Operation::begin()?;
    Ok(py.detach(|| {
        // Operations leave the values as they are, or replace them whole, so a poisoned one is safe to use.
        let mut guard = value.lock().unwrap_or_else(PoisonError::into_inner);
        let value = &mut *guard;
        operation.install(move || work(value))
    }))
}

/// Returns the error of a child process that cannot use what its parent has.
///
/// - `when`: when the process was forked
pub(crate) fn forked(when: &str) -> PyErr {
    TactnetError::new_err(format!(
        "this process was forked {when}; start processes with multiprocessing.get_context(\"spawn\"), or fork before"
    ))
}
