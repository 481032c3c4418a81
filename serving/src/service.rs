//! The service: frames and commands in, beliefs and status out.
//!
//! ```text
//! skin/<finger> ──> SweepSegmenter ──> OnlineClassifier ──> tactile/belief
//! sweep/command ──┘        └──────── events, counters ───> tactile/status
//!                   ModelWorker (a thread): new versions, enrolment, masks ──> swapped in between sweeps
//!                                           comparison with the training data ──> tactile/status
//! ```
//!
//! The service is one thread without its own clock. While it processes frames it allocates nothing, and its only system
//! calls are the waits and wake-ups of the channels.

mod command_rates;
mod commands;
mod complete_sweeps;
mod predict;
mod reconnect;
mod waiting_commands;
mod worker_events;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

use tactnet_channel::{
    Bus, GetPort, GetSide, Priority, PutPort, Received, Start, SyncGroup, Wait, now_ns,
};
use tactnet_pipeline::OnlineClassifier;
use tactnet_skin::packets::{
    Counters, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus, Text,
};
use tactnet_skin::{Frame, MAX_FINGERS};
use tactnet_skin::{Reject, ServeConfig, SweepChange, SweepSegmenter};

use crate::ServeError;
use crate::metrics::Metrics;
use crate::model::{ModelSource, ServedModel};
use crate::model_worker::{ModelWorker, WorkerEvent};
use crate::recent_sweeps::{CompleteSweep, SweepId};
use crate::skin_limits::{limits, settle};
use crate::status_line::StatusLine;
use command_rates::CommandRates;
use reconnect::Connections;
use waiting_commands::WaitingCommands;

/// Maximum time between two status packets, in ns.
const STATUS_INTERVAL_NS: u64 = 100_000_000;
/// Maximum number of frames of one finger processed in one step.
const MAX_FRAMES: usize = 256;
/// Number of complete sweeps for which memory is reserved: more than the worker has buffers.
const MAX_COMPLETE: usize = 4 * MAX_FINGERS;

/// The online classifier between its channels.
pub struct Service {
    bus: Bus,
    config: ServeConfig,
    group: SyncGroup,
    skins: Vec<GetPort<SkinFrame>>,
    commands: GetPort<SweepCommand>,
    beliefs: PutPort<TactileBelief>,
    status: PutPort<TactileStatus>,
    model: PutPort<ModelNames>,
    names: Box<ModelNames>,
    /// True if the first model's training data did not state its sample rate.
    rate_assumed: bool,
    /// True if the first model can compare sweeps with its training data.
    compares: bool,
    fingers: Vec<Finger>,
    waiting: WaitingCommands,
    counters: Counters,
    metrics: Arc<Metrics>,
    sweeps: u64,
    lost_commands: u64,
    command_rates: CommandRates,
    refusals_reported: Instant,
    refused_commands: u64,
    status_sent_ns: u64,
    connections: Connections,
    /// Messages for the operator since the last call of `take_messages`.
    messages: Vec<String>,
    /// Rejections since the last call of `take_messages`.
    rejections: Rejections,
    worker: ModelWorker,
    /// Sweeps that have not been handed to the worker.
    complete: VecDeque<CompleteSweep>,
    /// Event of the worker that waits for a pause between sweeps.
    worker_event: Option<WorkerEvent>,
    /// Replaced classifiers, to be freed by the worker.
    retired: Option<Vec<OnlineClassifier>>,
    /// Returns the number of allocations of this thread so far.
    allocations: fn() -> u64,
}

/// Sweeps rejected since the operator's last look.
#[derive(Default)]
struct Rejections {
    count: u64,
    /// Message about the newest one.
    newest: StatusLine<256>,
}

struct Finger {
    segmenter: SweepSegmenter,
    classifier: OnlineClassifier,
    sweep: u64,
    motion: u64,
    /// Number of window frames passed to the classifier.
    taken: usize,
    /// Number of window frames after which the next belief is due.
    next_belief: usize,
    /// Sequence numbers of the first and the newest frame.
    sequences: Option<(u64, u64)>,
    /// Time at which the newest frame was sent, in ns; 0 before the first.
    last_frame_ns: u64,
    /// Number of resets.
    object: u64,
    /// Newest verdict on the likeness with the training data.
    likeness: Option<Event>,
}

impl Service {
    /// Opens the channels and loads the newest model.
    ///
    /// - `git`: commit of the program, recorded with enrolled materials
    ///
    /// # Errors
    /// Fails without a hub, if channels are missing in the table, or if no model can serve.
    pub fn start(
        bus: &Bus,
        config: ServeConfig,
        source: ModelSource,
        git: &'static str,
    ) -> Result<Self, ServeError> {
        let (mut served, damaged) = source.load_newest(config.mc_samples, &config.dead)?;
        let version = served.version();
        let names = Box::new(served.names(config.mc_samples));
        let metrics = Arc::new(Metrics::serving(version, served.path()));
        let rate_assumed = served.classifier().config().sample_rate_assumed;
        let compares = served.compares();
        let fingers = open_fingers(&mut served, &config)?;
        let skins = config
            .fingers
            .iter()
            .map(|id| bus.get_port::<SkinFrame>(id.as_str(), Start::Now))
            .collect::<Result<Vec<_>, _>>()?;
        let commands = bus.get_port::<SweepCommand>(config.command.as_str(), Start::Now)?;
        let mut sides: Vec<&dyn GetSide> = skins.iter().map(|port| port as &dyn GetSide).collect();
        sides.push(&commands);
        let group = bus.sync_group(&sides)?;
        let mut service = Self {
            bus: bus.clone(),
            group,
            skins,
            commands,
            beliefs: bus
                .put_port(config.belief.as_str(), Priority::High)
                .map_err(|error| ServeError::of_belief_port(error, bus))?,
            status: bus.put_port(config.status.as_str(), Priority::Normal)?,
            model: bus.put_port(config.model.as_str(), Priority::Normal)?,
            names,
            rate_assumed,
            compares,
            fingers,
            waiting: WaitingCommands::new(config.fingers.len()),
            counters: Counters::default(),
            metrics: metrics.clone(),
            sweeps: 0,
            lost_commands: 0,
            command_rates: CommandRates::new(),
            refusals_reported: Instant::now(),
            refused_commands: 0,
            status_sent_ns: 0,
            connections: Connections::default(),
            messages: Vec::new(),
            rejections: Rejections::default(),
            worker: ModelWorker::start(served, source, &config, metrics, git)?,
            complete: VecDeque::with_capacity(MAX_COMPLETE),
            worker_event: None,
            retired: None,
            allocations: || 0,
            config,
        };
        service.model.put_copy(&[*service.names])?;
        service.publish_status(Event::Swapped, 0, format_args!("version {version} serves"))?;
        for error in damaged {
            service.publish_status(Event::ModelRejected, 0, format_args!("{error}"))?;
        }
        Ok(service)
    }

    /// Enables the allocation counter.
    ///
    /// - `allocations`: returns the number of allocations of the calling thread so far
    pub fn count_allocations(&mut self, allocations: fn() -> u64) {
        self.allocations = allocations;
    }

    /// Discards the frames and commands that arrived during start-up.
    ///
    /// # Errors
    /// Fails if the channels break down.
    pub fn drain(&mut self) -> Result<(), ServeError> {
        for skin in &self.skins {
            while skin.try_get()?.is_some() {}
        }
        // A sweep whose frames are gone must not begin.
        while self.commands.try_get()?.is_some() {}
        Ok(())
    }

    /// Returns the metrics, which other threads may read.
    pub fn metrics(&self) -> Arc<Metrics> {
        self.metrics.clone()
    }

    /// Returns the materials and shape of the serving model.
    pub fn names(&self) -> &ModelNames {
        &self.names
    }

    /// Returns the minimum and maximum value of a taxel, in digits; other values reject the sweep.
    pub fn values(&self) -> Option<[f32; 2]> {
        let served = || {
            self.fingers
                .first()
                .map(|finger| finger.classifier.config())
        };
        let set = self.config.segmenter.values;
        set.or_else(|| served().and_then(limits))
    }

    /// Returns true if the training data did not state its sample rate.
    pub fn is_rate_assumed(&self) -> bool {
        self.rate_assumed
    }

    /// Returns true if the model can detect unknown materials.
    pub fn tells_unknown(&self) -> bool {
        self.fingers
            .iter()
            .all(|finger| finger.classifier.tells_unknown())
    }

    /// Returns true if sweeps are compared with the training data.
    pub fn tells_unlike(&self) -> bool {
        self.compares
    }

    /// Returns the sequence numbers of the first and the newest frame, by finger.
    pub fn sequences(&self) -> Vec<Option<(u64, u64)>> {
        self.fingers.iter().map(|finger| finger.sequences).collect()
    }

    /// Returns the counters since the start.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Returns the messages for the operator since the last call, one line each.
    pub fn take_messages(&mut self) -> Vec<String> {
        let mut messages = std::mem::take(&mut self.messages);
        let Rejections { count, newest } = std::mem::take(&mut self.rejections);
        if count > 1 {
            messages.push(format!("{} sweeps rejected", count - 1));
        }
        if count > 0 {
            messages.push(newest.as_str().to_owned());
        }
        messages
    }

    /// Returns true if a finger that has sent frames is connected but has sent none for ten seconds.
    pub fn is_skin_silent(&self) -> bool {
        self.connections.skin_silent
    }

    /// Waits for a frame or a command and processes all that have arrived; returns after `timeout` at the latest.
    ///
    /// # Errors
    /// Fails if the channels break down.
    pub fn step(&mut self, timeout: Duration) -> Result<(), ServeError> {
        let ready = self.group.wait(Wait::Block { timeout })?;
        // Commands first: a frame is processed after all commands sent before it.
        self.receive_commands()?;
        if let Some(finger) = ready
            && finger < self.fingers.len()
        {
            let before = (self.allocations)();
            // The limit keeps a fast driver from blocking the other fingers.
            for _ in 0..MAX_FRAMES {
                let Some(frame) = self.skins[finger].try_get()? else {
                    break;
                };
                self.receive_commands()?;
                // The clock of another host is not comparable.
                let put_ns = match frame.header().remote {
                    0 => frame.header().put_ns,
                    _ => now_ns(),
                };
                self.execute_waiting(put_ns, Some(finger))?;
                self.frame(finger, &frame, put_ns)?;
            }
            self.counters.allocations += (self.allocations)() - before;
            // New subscribers are connected now, not when the next belief is due.
            self.beliefs.update_connections()?;
            self.status.update_connections()?;
        } else if ready.is_none() {
            // No frame is waiting, so all commands are due.
            self.execute_waiting(u64::MAX, None)?;
        }
        let now = now_ns();
        if now.saturating_sub(self.status_sent_ns) >= STATUS_INTERVAL_NS {
            self.model.send_history()?;
            self.publish_status(Event::Alive, 0, format_args!(""))?;
            self.keep_connections(now)?;
        }
        self.hand_over_sweeps();
        self.apply_worker_event()
    }

    fn frame(
        &mut self,
        number: usize,
        packet: &Received<SkinFrame>,
        put_ns: u64,
    ) -> Result<(), ServeError> {
        let Some(frame) = packet.first() else {
            return Ok(());
        };
        let finger = &mut self.fingers[number];
        let first = finger.sequences.map_or(frame.sequence, |(first, _)| first);
        finger.sequences = Some((first, frame.sequence));
        finger.last_frame_ns = put_ns;
        let change = finger.segmenter.push(&Frame {
            sequence: frame.sequence,
            sensor_time_nanos: frame.sensor_time_ns,
            taxels: frame.values(),
        });
        self.apply_change(number, change, frame.sequence, put_ns)?;
        self.counters.frames += 1;
        self.counters.dropped_frames = self.skins.iter().map(GetPort::lost).sum();
        let delay = now_ns().saturating_sub(put_ns);
        self.counters.worst_delay_ns = self.counters.worst_delay_ns.max(delay);
        self.metrics.count(&self.counters);
        Ok(())
    }

    fn apply_change(
        &mut self,
        number: usize,
        change: SweepChange,
        sequence: u64,
        put_ns: u64,
    ) -> Result<(), ServeError> {
        match change {
            SweepChange::Unchanged => Ok(()),
            SweepChange::Begun => self.begin(number, 0),
            SweepChange::Rejected(reject) => self.reject(number, &reject),
            SweepChange::RejectedAndBegun(reject) => {
                self.reject(number, &reject)?;
                self.begin(number, 0)
            }
            SweepChange::Extended => {
                let finger = &mut self.fingers[number];
                finger.catch_up();
                let due = self.config.anytime_ms > 0.0 && finger.taken >= finger.next_belief;
                if !due || finger.taken == 0 {
                    return Ok(());
                }
                let every = self.config.anytime_ms / 1e3 * self.names.sample_rate_hz;
                finger.next_belief = finger.taken + (every.ceil() as usize).max(1);
                self.predict(number, Stage::Anytime, sequence, put_ns)
            }
            SweepChange::Complete => {
                let finger = &mut self.fingers[number];
                finger.catch_up();
                self.predict(number, Stage::Plain, sequence, put_ns)?;
                if self.config.mc_samples > 0 {
                    self.predict(number, Stage::Dropout, sequence, put_ns)?;
                }
                self.keep_sweep(number);
                self.counters.sweeps += 1;
                self.publish_status(Event::Classified, number as u32, format_args!(""))
            }
        }
    }

    fn begin(&mut self, number: usize, motion: u64) -> Result<(), ServeError> {
        self.sweeps += 1;
        let every = self.config.anytime_ms / 1e3 * self.names.sample_rate_hz;
        let finger = &mut self.fingers[number];
        finger.classifier.begin();
        finger.sweep = self.sweeps;
        finger.motion = motion;
        finger.taken = 0;
        finger.next_belief = (every.ceil() as usize).max(1);
        self.publish_status(Event::Begun, number as u32, format_args!(""))
    }

    fn reject(&mut self, number: usize, reject: &Reject) -> Result<(), ServeError> {
        self.counters.rejected += 1;
        self.rejections.count += 1;
        self.rejections.newest = StatusLine::default();
        let sweep = self.fingers[number].sweep;
        self.rejections
            .newest
            .write(format_args!("sweep {sweep} rejected: {reject}"));
        self.publish_status(Event::Rejected, number as u32, format_args!("{reject}"))
    }

    fn publish_status(
        &mut self,
        event: Event,
        finger: u32,
        text: std::fmt::Arguments<'_>,
    ) -> Result<(), ServeError> {
        let newest = self.fingers.get(finger as usize);
        let (sweep, motion) = newest.map_or((0, 0), |finger| (finger.sweep, finger.motion));
        let id = SweepId {
            finger,
            sweep,
            motion,
        };
        self.publish_status_of(event, id, text)
    }

    /// - `id`: the sweep that the status names
    fn publish_status_of(
        &mut self,
        event: Event,
        id: SweepId,
        text: std::fmt::Arguments<'_>,
    ) -> Result<(), ServeError> {
        let mut line = StatusLine::<192>::default();
        line.write(text);
        self.status.put_copy(&[TactileStatus {
            event: event as u32,
            finger: id.finger,
            sweep: id.sweep,
            motion: id.motion,
            model_version: self.names.version,
            counters: self.counters,
            text: Text::new(line.as_str()),
        }])?;
        self.status_sent_ns = now_ns();
        Ok(())
    }
}

/// Creates the state of each finger for a model.
fn open_fingers(served: &mut ServedModel, config: &ServeConfig) -> Result<Vec<Finger>, ServeError> {
    let model = served.classifier().config().clone();
    let segmenter = settle(&config.segmenter, &model).map_err(|reason| ServeError::Unfit {
        path: served.path().into(),
        reason,
    })?;
    let fingers = config.fingers.iter().map(|_| {
        let mut segmenter = SweepSegmenter::new(
            segmenter,
            model.longest_trained(),
            model.taxel_shape().taxels(),
            model.sample_rate_hz,
        );
        if let Some(trained) = model.trained_steps {
            segmenter.accept_from(trained.shortest);
        }
        let classifier = served.online(config.mc_samples, &config.dead)?;
        segmenter.set_dead(classifier.dead().0.keys().copied());
        Ok(Finger {
            segmenter,
            classifier,
            sweep: 0,
            motion: 0,
            taken: 0,
            next_belief: 0,
            sequences: None,
            last_frame_ns: 0,
            object: 0,
            likeness: None,
        })
    });
    fingers.collect()
}

impl Finger {
    /// Passes the new frames of the window to the classifier.
    fn catch_up(&mut self) {
        let window = self.segmenter.window();
        while self.taken < window.kept() {
            self.classifier.push(window.row(self.taken));
            self.taken += 1;
        }
    }
}
