//! Recording of a run.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use tactnet_channel::{Bus, Table};
use tactnet_recording::{About, Counts, Recorder, RecordingError};

use crate::{RecordingReport, StageError};

/// Maximum sleep.
const LOOK: Duration = Duration::from_millis(10);

/// A recorder in its own thread. It completes the file in every case, and a failed recording does not stop the
/// run.
pub(crate) struct RunRecorder {
    stop: Arc<AtomicBool>,
    /// Absent after the end.
    thread: Option<JoinHandle<Result<Counts, RecordingError>>>,
}

impl RunRecorder {
    pub fn start(bus: &Bus, table: &Table, path: &Path, git: &str) -> Result<Self, StageError> {
        let about = About {
            git: git.into(),
            ..About::default()
        };
        let mut recorder = Recorder::start(bus, table, path, &about)?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = stop.clone();
        let thread = std::thread::Builder::new()
            .name("recorder".into())
            .spawn(move || {
                while !stopped.load(Ordering::Relaxed) {
                    recorder.step(LOOK)?;
                }
                recorder.finish()
            });
        let thread = thread.map_err(|source| StageError::Io {
            path: path.into(),
            source,
        })?;
        Ok(Self {
            stop,
            thread: Some(thread),
        })
    }

    /// Completes the file.
    pub fn finish(mut self) -> RecordingReport {
        match self.end() {
            Some(Ok(counts)) => RecordingReport {
                messages: counts.messages,
                lost: counts.lost,
                broke_off: None,
            },
            Some(Err(error)) => RecordingReport {
                broke_off: Some(error.to_string()),
                ..RecordingReport::default()
            },
            None => RecordingReport::default(),
        }
    }

    fn end(&mut self) -> Option<Result<Counts, RecordingError>> {
        self.stop.store(true, Ordering::Relaxed);
        let ended = self.thread.take()?.join();
        Some(ended.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }
}

impl Drop for RunRecorder {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.end();
        }
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::CatchStatus;
    use tactnet_catching_roles::catching_channels;
    use tactnet_channel::{Domain, Hub, Priority, remove_bus};
    use tactnet_recording::Recording;

    use super::*;

    #[test]
    fn a_run_that_fails_leaves_a_recording_that_was_ended_properly() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let name = format!("run-recorder{}", std::process::id());
        let table = catching_channels(Table::new(&name), None);
        let hub = Hub::spawn(&table).unwrap();
        let bus = Bus::open(Domain::Host, &table).unwrap();
        let recorder = RunRecorder::start(&bus, &table, &path, "").unwrap();
        let status = bus.put_port("catch/state", Priority::Normal).unwrap();
        status.put_copy(&[CatchStatus::zeroed()]).unwrap();
        // An error would drop the recorder in the same way.
        drop(recorder);
        let recording = Recording::read(&path).unwrap();
        assert_eq!((recording.cut, recording.entries.len()), (None, 1));
        drop((status, bus, hub));
        remove_bus(&table).unwrap();
    }
}
