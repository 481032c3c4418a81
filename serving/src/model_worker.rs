//! A second thread for work that must not delay a frame: loading models, comparing sweeps with the training data, enrolling
//! materials, freeing memory.

mod sweeps;

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
use crate::metrics::Metrics;
use crate::model::{ModelSource, ServedModel, numbered};
use crate::recent_sweeps::{CompleteSweep, SweepId};
use sweeps::SweptFinger;

/// Interval between checks for a new version.
const CHECK_INTERVAL: Duration = Duration::from_millis(500);

/// Number of buffers for the complete sweeps of each finger.
const BUFFERS: usize = 4;

/// A request of the service.
pub(crate) enum Job {
    /// Keep a complete sweep, and compare it and those before it with the training data.
    Sweep(CompleteSweep),
    /// Enroll `material` from the newest `sweeps` sweeps of an object.
    Enroll {
        finger: u32,
        /// Number of resets before the sweeps.
        object: u64,
        material: Text<56>,
        sweeps: usize,
    },
    /// Adapt the model to the newest `sweeps` sweeps of every finger.
    Adapt {
        /// Finger that the answer names.
        finger: u32,
        sweeps: usize,
    },
    /// Free these classifiers.
    Retire(Vec<OnlineClassifier>),
}

/// A result for the service.
pub(crate) enum WorkerEvent {
    /// Another model is ready to serve.
    Ready {
        classifiers: Vec<OnlineClassifier>,
        names: Box<ModelNames>,
        event: Event,
        finger: u32,
        text: Text<192>,
    },
    /// The sweeps of an object up to `id` were compared with the training data.
    Compared {
        id: SweepId,
        event: Event,
        text: Text<192>,
    },
    /// A job failed.
    Failed {
        event: Event,
        finger: u32,
        text: Text<192>,
    },
}

/// Handle of the worker thread, owned by the service.
pub(crate) struct ModelWorker {
    jobs: Option<SyncSender<Job>>,
    events: Option<Receiver<WorkerEvent>>,
    /// Buffers for complete sweeps, `[steps][taxels]` each, which the worker returns.
    buffers: Receiver<Vec<f32>>,
    /// Set while an event is queued, so that the service reads the queue only then.
    has_event: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl ModelWorker {
    /// Starts the thread with the serving model.
    pub(crate) fn start(
        model: ServedModel,
        source: ModelSource,
        config: &ServeConfig,
        metrics: Arc<Metrics>,
        git: &'static str,
    ) -> Result<Self, ServeError> {
        let fingers = config.fingers.len();
        let (jobs, requests) = sync_channel(4 + BUFFERS * fingers);
        let (sender, events) = sync_channel(4);
        let (free, buffers) = sync_channel(BUFFERS * fingers);
        let values = model.classifier().config().shape.values();
        for _ in 0..BUFFERS * fingers {
            // The channel holds all of them.
            let _ = free.try_send(vec![0.0; values]);
        }
        let has_event = Arc::new(AtomicBool::new(false));
        let mut worker = Worker {
            refused: BTreeSet::new(),
            model,
            source,
            swept: (0..fingers).map(|_| SweptFinger::new(values)).collect(),
            dead: config.dead.clone(),
            mask_dead: config.mask_dead,
            mc_samples: config.mc_samples,
            git,
            metrics,
            sender,
            free,
            has_event: has_event.clone(),
            scratch: None,
        };
        let thread = std::thread::Builder::new()
            .name("model-worker".into())
            .spawn(move || worker.run(&requests))
            .map_err(|source| ServeError::Io {
                path: "model-worker".into(),
                source,
            })?;
        Ok(Self {
            jobs: Some(jobs),
            events: Some(events),
            buffers,
            has_event,
            thread: Some(thread),
        })
    }

    /// Returns a buffer for a complete sweep; `None` while all are in use. Neither allocates nor blocks.
    pub(crate) fn free_buffer(&self) -> Option<Vec<f32>> {
        self.buffers.try_recv().ok()
    }

    /// Queues a job; returns it if the queue is full.
    pub(crate) fn ask(&self, job: Job) -> Result<(), Job> {
        match &self.jobs {
            Some(jobs) => jobs.try_send(job).map_err(|error| match error {
                TrySendError::Full(job) | TrySendError::Disconnected(job) => job,
            }),
            None => Err(job),
        }
    }

    /// Returns the next event, if there is one.
    pub(crate) fn next_event(&self) -> Option<WorkerEvent> {
        // Without an event this is one atomic load.
        if !self.has_event.load(Ordering::Acquire) {
            return None;
        }
        let events = self.events.as_ref()?;
        match events.try_recv() {
            Ok(event) => Some(event),
            Err(_) => {
                self.has_event.store(false, Ordering::Release);
                // An event sent between the two lines is received here.
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
        // Closing both channels ends the worker without processing queued jobs.
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
    swept: Vec<SweptFinger>,
    /// Dead taxels of every finger by the settings.
    dead: Vec<usize>,
    /// True if further dead taxels are searched for.
    mask_dead: bool,
    mc_samples: usize,
    git: &'static str,
    metrics: Arc<Metrics>,
    sender: SyncSender<WorkerEvent>,
    /// Takes back the buffers of complete sweeps.
    free: SyncSender<Vec<f32>>,
    has_event: Arc<AtomicBool>,
    /// Versions that cannot serve; each is reported once.
    refused: BTreeSet<u64>,
    /// Folder for enrolled and adapted models while a single run is served.
    scratch: Option<tempfile::TempDir>,
}

impl Worker {
    fn run(&mut self, requests: &Receiver<Job>) {
        let mut checked = Instant::now();
        loop {
            match requests.recv_timeout(CHECK_INTERVAL) {
                Ok(Job::Retire(classifiers)) => drop(classifiers),
                Ok(Job::Sweep(sweep)) => {
                    if !self.take_sweep(sweep) {
                        return;
                    }
                }
                Ok(Job::Enroll {
                    finger,
                    object,
                    material,
                    sweeps,
                }) => {
                    let enrolled = match self.digits_of(finger, object, material, sweeps) {
                        Ok(digits) => self.enroll(finger, material.as_str(), digits),
                        Err(reason) => self.refuse(finger, &reason),
                    };
                    if !enrolled {
                        return;
                    }
                }
                Ok(Job::Adapt { finger, sweeps }) => {
                    let adapted = match self.digits_of_all(sweeps) {
                        Ok(digits) => self.adapt(finger, digits),
                        Err(reason) => self.refuse(finger, &reason),
                    };
                    if !adapted {
                        return;
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            if checked.elapsed() >= CHECK_INTERVAL {
                self.check_for_new_version();
                checked = Instant::now();
            }
        }
    }

    /// Sends an event to the service; returns false if the service has ended.
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

    fn refuse(&self, finger: u32, reason: &str) -> bool {
        self.send(WorkerEvent::Failed {
            event: Event::Refused,
            finger,
            text: Text::new(reason),
        })
    }

    /// Loads a newer version, if there is one.
    fn check_for_new_version(&mut self) {
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
                    self.publish(
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
        let started = Instant::now();
        let masks = self.masks(finger);
        let enrolled = self.next_version().and_then(|(path, version)| {
            self.model.mask(&masks)?;
            self.model
                .enroll(material, digits, &path, version, self.git)
        });
        match enrolled {
            Ok(model) => {
                let text = format!(
                    "`{material}` enrolled in {:.2} s; fused sweeps discarded{}",
                    started.elapsed().as_secs_f64(),
                    self.until_end("; enroll it offline to keep it")
                );
                self.publish(model, Event::Enrolled, finger, &text)
            }
            Err(error) => self.fail(Event::Refused, finger, &error),
        }
    }

    fn adapt(&mut self, finger: u32, digits: Vec<f32>) -> bool {
        let was_calibrated = self.model.is_calibrated();
        let adapted = self
            .next_version()
            .and_then(|(path, version)| self.model.adapt(digits, &path, version, self.git));
        match adapted {
            Ok((model, adapted)) => {
                let unknown = match was_calibrated {
                    true => "; unknown materials are not detected any more",
                    false => "",
                };
                let text = format!(
                    "adapted to {} sweeps: the taxels shifted by {:.2} training spreads{unknown}{}",
                    adapted.presence.sweeps,
                    adapted.shift.level,
                    self.until_end("; adapt it offline to keep it")
                );
                self.publish(model, Event::Adapted, finger, &text)
            }
            Err(error) => self.fail(Event::Refused, finger, &error),
        }
    }

    /// Returns a remark, with a remedy, if a changed model is lost when the service ends.
    fn until_end(&self, remedy: &str) -> String {
        match self.source {
            ModelSource::Versions(_) => String::new(),
            ModelSource::Run(_) => format!("; it serves until this service ends{remedy}"),
        }
    }

    /// Returns the run directory and version of the next model.
    fn next_version(&mut self) -> Result<(PathBuf, u64), ServeError> {
        match &self.source {
            ModelSource::Versions(folder) => {
                // The version is above those that are damaged or incomplete.
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

    fn publish(&mut self, mut model: ServedModel, event: Event, finger: u32, text: &str) -> bool {
        match classifiers(&mut model, self.mc_samples, &self.all_masks()) {
            Ok(classifiers) => {
                self.metrics.loaded(model.version(), model.path());
                self.model = model;
                self.send_ready(classifiers, event, finger, text)
            }
            Err(error) => {
                self.refused.insert(model.version());
                self.fail(Event::ModelRejected, finger, &error)
            }
        }
    }

    /// Sends the classifiers of the serving model.
    fn send_ready(
        &self,
        classifiers: Vec<OnlineClassifier>,
        event: Event,
        finger: u32,
        text: &str,
    ) -> bool {
        self.send(WorkerEvent::Ready {
            classifiers,
            names: Box::new(self.model.names(self.mc_samples)),
            event,
            finger,
            text: Text::new(text),
        })
    }
}

/// Returns a classifier for every finger.
///
/// - `masks`: masked taxels of every finger
fn classifiers(
    model: &mut ServedModel,
    mc_samples: usize,
    masks: &[Vec<usize>],
) -> Result<Vec<OnlineClassifier>, ServeError> {
    let online = |dead: &Vec<usize>| model.online(mc_samples, dead);
    masks.iter().map(online).collect()
}
