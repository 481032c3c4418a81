//! Hub in a separate thread, for single-process programs and tests.

use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::{ChannelError, Hub, Table};

const TICK: Duration = Duration::from_millis(20);

/// A hub that runs in a thread until dropped.
#[derive(Debug)]
pub struct HubThread {
    stop: Sender<()>,
    thread: Option<JoinHandle<Result<(), ChannelError>>>,
}

impl Hub {
    /// Starts a hub in a new thread and waits until it is ready.
    ///
    /// # Errors
    /// The same as [`Hub::start`]; no thread can be started.
    ///
    /// ```
    /// use tactnet_channel::{Hub, Table, TemporaryBus, temporary_bus_name};
    ///
    /// let table = Table::new(&temporary_bus_name("doc-thread"));
    /// let _remove_at_the_end = TemporaryBus(&table);
    /// let hub = Hub::spawn(&table)?;
    /// assert!(Hub::start(&table).is_err()); // one hub a bus
    /// hub.stop()?;
    /// # Ok::<_, tactnet_channel::ChannelError>(())
    /// ```
    pub fn spawn(table: &Table) -> Result<HubThread, ChannelError> {
        let table = table.clone();
        let (stop, stopped) = channel::<()>();
        let (up, is_up) = channel();
        let run = move || {
            let mut hub = Self::start(&table)?;
            // The receiver may be gone.
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
        // The sender is dropped only if the hub could not start.
        if is_up.recv().is_err() {
            hub.end()?;
        }
        Ok(hub)
    }
}

impl HubThread {
    /// Stops the hub.
    ///
    /// # Errors
    /// The same as [`Hub::tick`], if the hub had failed before.
    pub fn stop(mut self) -> Result<(), ChannelError> {
        self.end()
    }

    fn end(&mut self) -> Result<(), ChannelError> {
        // The thread may have ended before.
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
