//! A hub in a thread of its own: for a process that is the only one, and for tests.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::{ChannelError, Hub, Table};

const TICK: Duration = Duration::from_millis(20);

/// A hub that ticks until this is dropped.
#[derive(Debug)]
pub struct HubThread {
    stop: Sender<()>,
    thread: Option<JoinHandle<Result<(), ChannelError>>>,
}

impl Hub {
    /// Starts a hub in a new thread and waits until it is up.
    ///
    /// # Errors
    /// As [`Hub::start`]; no thread can be started.
    pub fn spawn(table: &Table) -> Result<HubThread, ChannelError> {
        let table = table.clone();
        let (stop, stopped) = channel::<()>();
        let (up, is_up) = channel();
        let run = move || {
            let mut hub = Self::start(&table)?;
            // Whoever waits for it may be gone.
            let _ = up.send(());
            while stopped.recv_timeout(TICK) == Err(RecvTimeoutError::Timeout) {
                hub.tick()?;
            }
            Ok(())
        };
        let thread = std::thread::Builder::new()
            .name("channel hub".into())
            .spawn(run)
            .map_err(|source| ChannelError::Io {
                path: "channel hub".into(),
                action: "start",
                source,
            })?;
        let mut hub = HubThread {
            stop,
            thread: Some(thread),
        };
        // The other end is gone only if the hub could not start.
        if is_up.recv().is_err() {
            hub.end()?;
        }
        Ok(hub)
    }
}

impl HubThread {
    /// Ends the hub and says what ended it before, if anything did.
    ///
    /// # Errors
    /// As [`Hub::tick`].
    pub fn stop(mut self) -> Result<(), ChannelError> {
        self.end()
    }

    fn end(&mut self) -> Result<(), ChannelError> {
        // It may have ended by itself.
        let _ = self.stop.send(());
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(outcome)) => outcome,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => Ok(()),
        }
    }
}

impl Drop for HubThread {
    fn drop(&mut self) {
        let _ = self.stop.send(());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
