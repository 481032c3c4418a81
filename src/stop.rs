//! Ctrl-C and SIGTERM: the first asks to stop after the current batch, the second ends the process.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;
use tactnet_experiments::STOPPING;

/// Remembers that somebody asked to stop.
#[derive(Clone)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Starts to listen, for work that can be resumed.
    pub fn listen() -> anyhow::Result<Self> {
        Self::listen_saying(STOPPING)
    }

    /// Starts to listen; `text` is what people read when they ask.
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

    /// Returns true once somebody asked.
    pub fn asked(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
