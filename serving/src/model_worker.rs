//! A second thread for work that must not keep a frame waiting: loading models, learning materials, freeing memory.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tactnet_pipeline::OnlineClassifier;
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::{Event, ModelNames, Text};

use crate::ServeError;
use crate::measures::Measures;
use crate::model::{ModelSource, ServedModel, numbered};

/// How often it looks for a new version.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// A request of the service.
pub(crate) enum Job {
    /// Learn `material` from `[sweeps][steps][taxels]` digits.
    Enroll {
        finger: u32,
        material: Text<56>,
        digits: Vec<f32>,
    },
    /// Drop these: freeing memory takes its time.
    Retire(Vec<OnlineClassifier>),
}

/// An answer to the service.
pub(crate) enum WorkerEvent {
    /// Another model is ready.
    Ready {
        classifiers: Vec<OnlineClassifier>,
        names: Box<ModelNames>,
        event: Event,
        finger: u32,
        text: Text<192>,
    },
    /// Something did not work out.
    Failed {
        event: Event,
        finger: u32,
        text: Text<192>,
    },
}

/// The service's end.
pub(crate) struct ModelWorker {
    jobs: Option<SyncSender<Job>>,
    events: Option<Receiver<WorkerEvent>>,
    /// Set when an event waits, so that the service looks into the channel only then.
    has_event: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ModelWorker {
    /// Starts the thread with the model that serves.
    pub(crate) fn start(
        model: ServedModel,
        source: ModelSource,
        config: &ServeConfig,
        measures: Arc<Measures>,
        git: &'static str,
    ) -> Result<Self, ServeError> {
        let (jobs, wanted) = sync_channel(4);
        let (sender, events) = sync_channel(4);
        let has_event = Arc::new(AtomicBool::new(false));
        let mut worker = Worker {
            refused: BTreeSet::new(),
            model,
            source,
            fingers: config.fingers.len(),
            mc_samples: config.mc_samples,
            git,
            measures,
            sender,
            has_event: has_event.clone(),
            scratch: None,
        };
        let thread = std::thread::Builder::new()
            .name("model-worker".into())
            .spawn(move || worker.run(&wanted))
            .map_err(|source| ServeError::Io {
                path: "model-worker".into(),
                source,
            })?;
        Ok(Self {
            jobs: Some(jobs),
            events: Some(events),
            has_event,
            thread: Some(thread),
        })
    }

    /// Hands a job over; gives it back if the worker is busy.
    pub(crate) fn ask(&self, job: Job) -> Result<(), Job> {
        match &self.jobs {
            Some(jobs) => jobs.try_send(job).map_err(|error| match error {
                TrySendError::Full(job) | TrySendError::Disconnected(job) => job,
            }),
            None => Err(job),
        }
    }

    /// Returns the next event, if one waits.
    pub(crate) fn next_event(&self) -> Option<WorkerEvent> {
        // Without an event this is one read of memory.
        if !self.has_event.load(Ordering::Acquire) {
            return None;
        }
        let events = self.events.as_ref()?;
        match events.try_recv() {
            Ok(event) => Some(event),
            Err(_) => {
                self.has_event.store(false, Ordering::Release);
                // What was sent between the two lines is found next time.
                let late = events.try_recv().ok();
                if late.is_some() {
                    self.has_event.store(true, Ordering::Release);
                }
                late
            }
        }
    }
}

impl Drop for ModelWorker {
    fn drop(&mut self) {
        // Without both ends the worker neither waits for us nor works off what is left.
        drop(self.events.take());
        drop(self.jobs.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Worker {
    model: ServedModel,
    source: ModelSource,
    fingers: usize,
    mc_samples: usize,
    git: &'static str,
    measures: Arc<Measures>,
    sender: SyncSender<WorkerEvent>,
    has_event: Arc<AtomicBool>,
    /// Versions that cannot serve, each said once.
    refused: BTreeSet<u64>,
    /// Holds what is learnt while a single run serves.
    scratch: Option<tempfile::TempDir>,
}

impl Worker {
    fn run(&mut self, wanted: &Receiver<Job>) {
        let mut looked = Instant::now();
        loop {
            match wanted.recv_timeout(LOOK_EVERY) {
                Ok(Job::Retire(classifiers)) => drop(classifiers),
                Ok(Job::Enroll {
                    finger,
                    material,
                    digits,
                }) => {
                    if !self.enroll(finger, material.as_str(), digits) {
                        return;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if looked.elapsed() >= LOOK_EVERY {
                self.look();
                looked = Instant::now();
            }
        }
    }

    /// Sends an event to the service; returns false when the service has ended.
    fn send(&self, event: WorkerEvent) -> bool {
        let sent = self.sender.send(event).is_ok();
        self.has_event.store(true, Ordering::Release);
        sent
    }

    fn fail(&self, event: Event, finger: u32, error: &ServeError) -> bool {
        self.send(WorkerEvent::Failed {
            event,
            finger,
            text: Text::new(&error.to_string()),
        })
    }

    /// Looks for a newer version.
    fn look(&mut self) {
        if self.source == ModelSource::Run(self.model.path().into()) || self.scratch.is_some() {
            return;
        }
        let Ok(versions) = self.source.versions() else {
            return;
        };
        for (version, path) in versions {
            if version <= self.model.version() {
                return;
            }
            if self.refused.contains(&version) {
                continue;
            }
            let loaded = ServedModel::load(&path, version).and_then(|model| {
                model.check_replaces(&self.model)?;
                Ok(model)
            });
            match loaded {
                Ok(model) => {
                    self.offer(
                        model,
                        Event::Swapped,
                        0,
                        &format!("version {version} serves"),
                    );
                    return;
                }
                Err(error) => {
                    self.refused.insert(version);
                    self.fail(Event::ModelRejected, 0, &error);
                }
            }
        }
    }

    fn enroll(&mut self, finger: u32, material: &str, digits: Vec<f32>) -> bool {
        let begun = Instant::now();
        let learnt = self.place().and_then(|(path, version)| {
            self.model
                .enroll(material, digits, &path, version, self.git)
        });
        match learnt {
            Ok(model) => {
                let kept = match self.source {
                    ModelSource::Versions(_) => "",
                    ModelSource::Run(_) => {
                        "; it serves until this service ends, `tactnet enroll` keeps a material"
                    }
                };
                let text = format!(
                    "`{material}` learnt in {:.2} s; what was fused is forgotten{kept}",
                    begun.elapsed().as_secs_f64()
                );
                self.offer(model, Event::Enrolled, finger, &text)
            }
            Err(error) => self.fail(Event::Refused, finger, &error),
        }
    }

    /// Where a classifier with one more material goes.
    fn place(&mut self) -> Result<(PathBuf, u64), ServeError> {
        match &self.source {
            ModelSource::Versions(folder) => {
                // Also above what is damaged or still on its way.
                let newest = numbered(folder)?
                    .into_iter()
                    .map(|(number, _)| number)
                    .max();
                let version = newest.unwrap_or(0).max(self.model.version()) + 1;
                Ok((folder.join(version.to_string()), version))
            }
            ModelSource::Run(path) => {
                let version = self.model.version() + 1;
                let failed = |source| ServeError::Io {
                    path: path.clone(),
                    source,
                };
                if self.scratch.is_none() {
                    self.scratch = Some(tempfile::tempdir().map_err(failed)?);
                }
                let folder = self.scratch.as_ref().map(|folder| folder.path());
                let folder = folder.unwrap_or(path);
                Ok((folder.join(version.to_string()), version))
            }
        }
    }

    fn offer(&mut self, model: ServedModel, event: Event, finger: u32, text: &str) -> bool {
        let classifiers: Result<Vec<_>, _> = (0..self.fingers)
            .map(|_| model.online(self.mc_samples))
            .collect();
        match classifiers {
            Ok(classifiers) => {
                self.measures.loaded(model.version(), model.path());
                let sent = self.send(WorkerEvent::Ready {
                    classifiers,
                    names: Box::new(model.names(self.mc_samples)),
                    event,
                    finger,
                    text: Text::new(text),
                });
                self.model = model;
                sent
            }
            Err(error) => {
                self.refused.insert(model.version());
                self.fail(Event::ModelRejected, finger, &error)
            }
        }
    }
}
