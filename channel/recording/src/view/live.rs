//! Live view of channels that never blocks the caller.

use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tactnet_channel::Table;

use super::{Play, Scene, Target};
use crate::{Entry, RecordedPacket, RecordingError};

/// Maximum number of batches that wait for the viewer: three seconds at twenty a second, about 0.5 MB per finger.
const WAITING: usize = 64;
/// Maximum number of other packets than frames that are kept for a slow viewer.
const KEPT: usize = 1024;
/// Interval at which the connection to the viewer is checked, and timeout of its reply.
const ASKED_EVERY: Duration = Duration::from_secs(1);

/// A viewer with its own thread. Frames are left out and counted if the viewer is too slow, so memory stays bounded.
pub struct LiveView {
    batches: Option<SyncSender<Vec<Entry>>>,
    thread: Option<JoinHandle<Result<(), RecordingError>>>,
    /// Packets of refused batches, except frames.
    kept: Vec<Entry>,
    left_out: u64,
}

impl LiveView {
    /// Starts the view.
    ///
    /// - `table`: table of the channels
    ///
    /// # Errors
    /// No viewer can be reached; the file exists; the table has no section of the classifier.
    pub fn start(target: &Target, title: &str, table: &Table) -> Result<Self, RecordingError> {
        let scene = Scene::of_channels(target, title, table, Play::Following)?;
        let (sender, batches) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("view".into())
            .spawn(move || show(scene, &batches))
            .map_err(|error| RecordingError::Viewer(error.to_string()))?;
        Ok(Self::feeding(sender, thread))
    }

    fn feeding(
        batches: SyncSender<Vec<Entry>>,
        thread: JoinHandle<Result<(), RecordingError>>,
    ) -> Self {
        Self {
            batches: Some(batches),
            thread: Some(thread),
            kept: Vec::new(),
            left_out: 0,
        }
    }

    /// Passes a batch on. Never waits.
    ///
    /// # Errors
    /// The viewer has gone; the file cannot be written.
    pub fn show(&mut self, batch: Vec<Entry>) -> Result<(), RecordingError> {
        let Some(batches) = &self.batches else {
            return Ok(());
        };
        let mut all = std::mem::take(&mut self.kept);
        all.extend(batch);
        match batches.try_send(all) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(mut batch)) => {
                let received = batch.len();
                batch.retain(|entry| !matches!(entry.packet, RecordedPacket::Frame(_)));
                let oldest = batch.len().saturating_sub(KEPT);
                batch.drain(..oldest);
                self.left_out += (received - batch.len()) as u64;
                self.kept = batch;
                Ok(())
            }
            Err(TrySendError::Disconnected(_)) => self.end(),
        }
    }

    /// Returns the number of packets that were left out because the viewer was too slow.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Shows the waiting batches and `last`.
    ///
    /// - `patience`: timeout; `None`: no timeout
    ///
    /// # Errors
    /// The viewer has gone or exceeds the timeout; the file cannot be written.
    pub fn finish(
        &mut self,
        last: Vec<Entry>,
        patience: Option<Duration>,
    ) -> Result<(), RecordingError> {
        let begun = Instant::now();
        let waits = || patience.is_none_or(|patience| begun.elapsed() < patience);
        let mut last = std::mem::take(&mut self.kept)
            .into_iter()
            .chain(last)
            .collect::<Vec<_>>();
        while let Some(batches) = &self.batches {
            match batches.try_send(std::mem::take(&mut last)) {
                Err(TrySendError::Full(batch)) if waits() => {
                    last = batch;
                    std::thread::sleep(Duration::from_millis(5));
                }
                Err(TrySendError::Full(batch)) => {
                    self.left_out += batch.len() as u64;
                    self.batches = None;
                }
                _ => self.batches = None,
            }
        }
        while self.thread.as_ref().is_some_and(|t| !t.is_finished()) {
            if !waits() {
                let reason = "it did not accept the remaining packets in time".into();
                return Err(RecordingError::ViewerGone(reason));
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.end()
    }

    fn end(&mut self) -> Result<(), RecordingError> {
        self.batches = None;
        match self.thread.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(outcome)) => outcome,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
        }
    }
}

fn show(mut scene: Scene, batches: &Receiver<Vec<Entry>>) -> Result<(), RecordingError> {
    let mut asked = Instant::now();
    while let Ok(batch) = batches.recv() {
        for entry in &batch {
            scene.show(entry)?;
        }
        scene.flush()?;
        if asked.elapsed() > ASKED_EVERY {
            // A slow viewer is not an error.
            scene.has_arrived(ASKED_EVERY)?;
            asked = Instant::now();
        }
    }
    scene.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch() -> Vec<Entry> {
        let packet = RecordedPacket::Frame(Box::new(bytemuck::Zeroable::zeroed()));
        let entry = Entry {
            channel: "skin/right".into(),
            time_ns: 0,
            sender: None,
            packet,
        };
        vec![entry; 40]
    }

    fn named() -> Entry {
        Entry {
            channel: "tactile/model".into(),
            time_ns: 0,
            sender: None,
            packet: RecordedPacket::Model(Box::new(bytemuck::Zeroable::zeroed())),
        }
    }

    #[test]
    fn a_slow_viewer_costs_frames_only_and_nobody_waits_for_it() {
        let (sender, batches) = sync_channel::<Vec<Entry>>(WAITING);
        let (go_on, gate) = sync_channel::<()>(0);
        let thread = std::thread::spawn(move || {
            // The writer blocks until the gate opens.
            gate.recv().unwrap();
            let names = batches.iter().flatten();
            let names = names.filter(|e| matches!(e.packet, RecordedPacket::Model(_)));
            assert_eq!(names.count(), 1);
            Ok(())
        });
        let mut view = LiveView::feeding(sender, thread);
        for _ in 0..WAITING + 5 {
            view.show(batch()).unwrap();
        }
        assert_eq!(view.left_out(), 5 * 40);
        let mut last = batch();
        last.push(named());
        view.show(last).unwrap();
        assert_eq!((view.left_out(), view.kept.len()), (6 * 40, 1));
        let mut slow = LiveView::feeding(
            view.batches.clone().unwrap(),
            std::thread::spawn(|| {
                loop {
                    std::thread::park();
                }
            }),
        );
        let found = slow.finish(batch(), Some(Duration::from_millis(50)));
        assert!(matches!(found, Err(RecordingError::ViewerGone(_))));
        assert_eq!(slow.left_out(), 40);
        drop(slow);
        go_on.send(()).unwrap();
        view.finish(batch(), None).unwrap();
        assert_eq!(view.left_out(), 6 * 40);
    }

    #[test]
    fn a_viewer_that_was_closed_is_told_once() {
        let (sender, batches) = sync_channel(WAITING);
        drop(batches);
        let closed = || Err(RecordingError::ViewerGone("closed".into()));
        let mut view = LiveView::feeding(sender, std::thread::spawn(closed));
        let outcome = view.show(batch());
        assert!(matches!(outcome, Err(RecordingError::ViewerGone(_))));
        view.show(batch()).unwrap();
        view.finish(batch(), None).unwrap();
    }
}
