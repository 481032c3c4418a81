//! Channels on the screen while things happen, without anybody waiting for the screen.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tactnet_channel::Table;

use super::{Scene, Target, TimeOrigin, ViewError};
use crate::{Entry, RecordedPacket};

/// Batches that wait for the viewer; at twenty a second three seconds, about 1 MB a finger.
const WAITING: usize = 64;
/// How often the viewer is asked whether it is still there.
const ASKED_EVERY: Duration = Duration::from_secs(1);

/// A viewer that is fed by a thread of its own. What it is too slow for is left out and counted: memory stays bounded.
pub struct LiveView {
    batches: Option<SyncSender<Vec<Entry>>>,
    thread: Option<JoinHandle<Result<(), ViewError>>>,
    left_out: u64,
}

impl LiveView {
    /// - `table`: of the channels that are shown
    ///
    /// # Errors
    /// No viewer there; a file that is there already; a table without the classifier's section.
    pub fn start(target: &Target, title: &str, table: &Table) -> Result<Self, ViewError> {
        let scene = Scene::of_channels(target, title, table, true)?;
        let (sender, batches) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("view".into())
            .spawn(move || show(scene, &batches))
            .map_err(|error| ViewError::Rerun(error.to_string()))?;
        Ok(Self {
            batches: Some(sender),
            thread: Some(thread),
            left_out: 0,
        })
    }

    /// Hands a batch on; never waits.
    ///
    /// # Errors
    /// The viewer has gone.
    pub fn show(&mut self, batch: Vec<Entry>) -> Result<(), ViewError> {
        let Some(batches) = &self.batches else {
            return Ok(());
        };
        match batches.try_send(batch) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(batch)) => {
                let frames = |entry: &&Entry| matches!(entry.packet, RecordedPacket::Frame(_));
                self.left_out += batch.iter().filter(frames).count() as u64;
                Ok(())
            }
            Err(TrySendError::Disconnected(_)) => self.end(),
        }
    }

    /// Frames that were left out because the viewer was too slow.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Shows what still waits and `last`, for so long at most; nothing where the viewer has gone.
    ///
    /// # Errors
    /// The viewer takes too long.
    pub fn finish(mut self, last: Vec<Entry>, patience: Duration) -> Result<(), ViewError> {
        self.show(last)?;
        self.batches = None;
        let begun = Instant::now();
        while self.thread.as_ref().is_some_and(|t| !t.is_finished()) {
            if begun.elapsed() > patience {
                return Err(ViewError::Gone("it does not take what is left".into()));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.end()
    }

    fn end(&mut self) -> Result<(), ViewError> {
        self.batches = None;
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(outcome)) => outcome,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

fn show(mut scene: Scene, batches: &Receiver<Vec<Entry>>) -> Result<(), ViewError> {
    let mut asked = Instant::now();
    while let Ok(batch) = batches.recv() {
        for entry in &batch {
            scene.show(entry)?;
        }
        scene.flush()?;
        if asked.elapsed() > ASKED_EVERY {
            scene.wait()?;
            asked = Instant::now();
        }
    }
    scene.finish()
}

impl Scene {
    /// Of the classifier's channels; `live`: time follows what comes.
    ///
    /// # Errors
    /// No viewer there; a file that is there already; a table without the classifier's section.
    pub fn of_channels(
        target: &Target,
        title: &str,
        table: &Table,
        live: bool,
    ) -> Result<Self, ViewError> {
        let config = tactnet_serving::ServeConfig::of(table)
            .map_err(|error| ViewError::Rerun(error.to_string()))?;
        let fingers: Vec<&str> = config.fingers.iter().map(String::as_str).collect();
        Self::open(target, title, &fingers, TimeOrigin::Epoch, live)
    }
}

#[cfg(test)]
mod tests {
    use tactnet_serving::packets::SkinFrame;

    use super::*;

    fn batch() -> Vec<Entry> {
        let packet = RecordedPacket::Frame(bytemuck::Zeroable::zeroed());
        let entry = Entry {
            channel: "skin/right".into(),
            time_ns: 0,
            packet,
        };
        vec![entry; 40]
    }

    #[test]
    fn a_slow_viewer_costs_frames_and_nobody_waits_for_it() {
        assert!(size_of::<SkinFrame>() * 40 * WAITING < 2 << 20, "bounded");
        let (sender, batches) = sync_channel(WAITING);
        let thread = std::thread::spawn(move || {
            // It takes none for long.
            std::thread::sleep(Duration::from_millis(1500));
            while batches.recv().is_ok() {}
            Ok(())
        });
        let mut view = LiveView {
            batches: Some(sender),
            thread: Some(thread),
            left_out: 0,
        };
        let begun = Instant::now();
        for _ in 0..WAITING + 5 {
            view.show(batch()).unwrap();
        }
        assert!(begun.elapsed() < Duration::from_millis(1400), "none waited");
        assert_eq!(view.left_out(), 5 * 40);
        let slow = view.finish(batch(), Duration::from_millis(50));
        assert!(matches!(slow, Err(ViewError::Gone(_))), "{slow:?}");
    }

    #[test]
    fn a_viewer_that_was_closed_is_told_once() {
        let (sender, batches) = sync_channel(WAITING);
        drop(batches);
        let thread = std::thread::spawn(|| Err(ViewError::Gone("closed".into())));
        let mut view = LiveView {
            batches: Some(sender),
            thread: Some(thread),
            left_out: 0,
        };
        assert!(matches!(view.show(batch()), Err(ViewError::Gone(_))));
        view.show(batch()).unwrap();
        view.finish(batch(), Duration::from_secs(1)).unwrap();
    }
}
