//! Ctrl-C and SIGTERM: the first requests a stop, the second ends the process. SIGUSR1 triggers a recording.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tactnet_experiments::STOPPING;

static TRIGGERED: AtomicBool = AtomicBool::new(false);

/// Flag that is set by the first Ctrl-C or SIGTERM.
#[derive(Clone)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Installs the handler, for work that can be resumed.
    pub fn listen() -> anyhow::Result<Self> {
        Self::listen_saying(STOPPING)
    }

    /// Installs the handler, which prints `text` when a stop is requested.
    pub fn listen_saying(text: &'static str) -> anyhow::Result<Self> {
        let asked = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&asked);
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::SeqCst) {
                std::process::exit(i32::from(crate::failure::INTERRUPTED));
            }
            say!("\n{text}");
        })
        .context("cannot listen for Ctrl-C")?;
        Ok(Self(asked))
    }

    /// Installs a handler for SIGUSR1, with which [`Stop::take_trigger`] returns true.
    pub fn listen_to_triggers() {
        extern "C" fn trigger(_: libc::c_int) {
            TRIGGERED.store(true, Ordering::SeqCst);
        }
        let handler = trigger as extern "C" fn(libc::c_int);
        // SAFETY: the handler only stores an atomic.
        unsafe { libc::signal(libc::SIGUSR1, handler as libc::sighandler_t) };
    }

    /// Returns true once for each time that SIGUSR1 has arrived.
    pub fn take_trigger() -> bool {
        TRIGGERED.swap(false, Ordering::SeqCst)
    }

    /// Returns true once a stop was requested.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
