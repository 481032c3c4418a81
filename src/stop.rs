//! Ctrl-C and SIGTERM: the first requests a stop, the second ends the process.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tactnet_experiments::STOPPING;

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

    /// Returns true once a stop was requested.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
