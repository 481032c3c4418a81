//! The service: frames and commands in, beliefs and status out.
//!
//! ```text
//! skin/<finger> ──> SweepSegmenter ──> OnlineClassifier ──> tactile/belief
//! sweep/command ──┘        └──────── events, counters ───> tactile/status
//!                   ModelWorker (a thread): new versions, enrolment ──> swapped in between sweeps
//! ```
//!
//! One thread, no clock but the channels' own. While frames come nothing is allocated, and the only system calls are the waits and wake-ups of the channels.

mod command_rates;
mod commands;
mod predict;
mod recent_sweeps;
mod reconnect;
mod waiting_commands;
mod worker_events;

use std::sync::Arc;
use std::time::{Duration, Instant};

use tactnet_channel::{
    Bus, GetPort, GetSide, Priority, PutPort, Received, Start, SyncGroup, Wait, now_ns,
};
use tactnet_pipeline::OnlineClassifier;
use tactnet_skin::Frame;
use tactnet_skin::packets::{
    Counters, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief, TactileStatus, Text,
};
use tactnet_skin::{Reject, ServeConfig, SweepChange, SweepSegmenter};

use crate::ServeError;
use crate::measures::Measures;
use crate::model::ModelSource;
use crate::model_worker::{ModelWorker, WorkerEvent};
use crate::skin_limits::{limits, settle};
use crate::status_line::StatusLine;
use command_rates::CommandRates;
use recent_sweeps::RecentSweeps;
use reconnect::Connections;
use waiting_commands::WaitingCommands;

/// Status is put at least this often.
const ALIVE_EVERY_NS: u64 = 100_000_000;
/// Frames of a finger in one go.
const MAX_FRAMES: usize = 256;

/// The classifier on its channels.
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
    /// True if nobody said at what rate the first model's sweeps were recorded.
    rate_assumed: bool,
    fingers: Vec<Finger>,
    waiting: WaitingCommands,
    counters: Counters,
    measures: Arc<Measures>,
    sweeps: u64,
    lost_commands: u64,
    command_rates: CommandRates,
    told_refused: Instant,
    refused_commands: u64,
    alive_ns: u64,
    connections: Connections,
    /// For whoever started it, since the last call.
    news: Vec<String>,
    /// Rejections that nobody was told of yet, and the newest of them.
    untold: (u64, StatusLine<256>),
    worker: ModelWorker,
    /// An event of the worker that waits for a pause between sweeps.
    worker_event: Option<WorkerEvent>,
    /// Classifiers that have served, on their way to the worker, which frees them.
    retired: Option<Vec<OnlineClassifier>>,
    /// Allocations of this thread so far.
    allocations: fn() -> u64,
}

struct Finger {
    segmenter: SweepSegmenter,
    classifier: OnlineClassifier,
    sweep: u64,
    motion: u64,
    /// Rows of the window that the classifier has.
    taken: usize,
    /// Rows after which the next belief is due.
    next_belief: usize,
    /// First and newest frame.
    sequences: Option<(u64, u64)>,
    /// When the newest was put; 0 before the first.
    framed_ns: u64,
    recent: RecentSweeps,
}

impl Service {
    /// Opens the channels and loads the newest model.
    ///
    /// - `git`: commit of the program, for the provenance of materials that it learns
    ///
    /// # Errors
    /// No hub, channels missing in the table, a model that cannot serve.
    pub fn start(
        bus: &Bus,
        config: ServeConfig,
        source: ModelSource,
        git: &'static str,
    ) -> Result<Self, ServeError> {
        let (served, damaged) = source.load_newest(config.mc_samples)?;
        let version = served.version();
        let names = Box::new(served.names(config.mc_samples));
        let measures = Arc::<Measures>::default();
        measures.loaded(version, served.path());
        measures.serve(version);
        let shape = served.classifier().config().shape;
        let rate_assumed = served.classifier().config().sample_rate_assumed;
        let segmenter = settle(&config.segmenter, served.classifier().config());
        let segmenter = segmenter.map_err(|reason| ServeError::Unfit {
            path: served.path().into(),
            reason,
        })?;
        let fingers = config.fingers.iter().map(|_| {
            Ok(Finger {
                segmenter: SweepSegmenter::new(
                    segmenter,
                    shape.steps,
                    shape.taxels(),
                    names.sample_rate_hz,
                ),
                classifier: served.online(config.mc_samples)?,
                sweep: 0,
                motion: 0,
                taken: 0,
                next_belief: 0,
                sequences: None,
                framed_ns: 0,
                recent: RecentSweeps::new(shape.values()),
            })
        });
        let fingers = fingers.collect::<Result<Vec<_>, ServeError>>()?;
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
            fingers,
            waiting: WaitingCommands::new(config.fingers.len()),
            counters: Counters::default(),
            measures: measures.clone(),
            sweeps: 0,
            lost_commands: 0,
            command_rates: CommandRates::new(),
            told_refused: Instant::now(),
            refused_commands: 0,
            alive_ns: 0,
            connections: Connections::default(),
            news: Vec::new(),
            untold: Default::default(),
            worker: ModelWorker::start(served, source, &config, measures, git)?,
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

    /// Counts allocations while frames are processed.
    ///
    /// - `allocations`: of the calling thread, since it began
    pub fn count_allocations(&mut self, allocations: fn() -> u64) {
        self.allocations = allocations;
    }

    /// Drops the frames and commands that came while the thread was being prepared, so that it begins with what happens now.
    ///
    /// # Errors
    /// The channels have broken down.
    pub fn drain(&mut self) -> Result<(), ServeError> {
        for skin in &self.skins {
            while skin.try_get()?.is_some() {}
        }
        // A sweep whose frames are gone must not begin.
        while self.commands.try_get()?.is_some() {}
        Ok(())
    }

    /// Returns its counters, to be read from other threads.
    pub fn measures(&self) -> Arc<Measures> {
        self.measures.clone()
    }

    /// Returns the names of the model that serves.
    pub fn names(&self) -> &ModelNames {
        &self.names
    }

    /// Returns the least and the greatest value that a taxel may show; others reject the sweep.
    pub fn values(&self) -> Option<[f32; 2]> {
        let served = || {
            self.fingers
                .first()
                .map(|finger| finger.classifier.config())
        };
        let set = self.config.segmenter.values;
        set.or_else(|| served().and_then(limits))
    }

    /// Returns true if the rate of the sweeps that the model was trained on is only assumed.
    pub fn is_rate_assumed(&self) -> bool {
        self.rate_assumed
    }

    /// Returns true if it can tell unknown materials.
    pub fn tells_unknown(&self) -> bool {
        self.fingers
            .iter()
            .all(|finger| finger.classifier.tells_unknown())
    }

    /// Returns the sequence of the first and the newest frame of every finger.
    pub fn sequences(&self) -> Vec<Option<(u64, u64)>> {
        self.fingers.iter().map(|finger| finger.sequences).collect()
    }

    /// Returns the counters since the start.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Returns what its operator should know since the last call, a line each.
    pub fn take_news(&mut self) -> Vec<String> {
        let mut news = std::mem::take(&mut self.news);
        let (count, newest) = std::mem::take(&mut self.untold);
        if count > 1 {
            news.push(format!("{} sweeps rejected", count - 1));
        }
        if count > 0 {
            news.push(newest.as_str().to_owned());
        }
        news
    }

    /// Returns true if frames of a finger came once and have not for ten seconds, although a skin is connected.
    pub fn is_blind(&self) -> bool {
        self.connections.blind
    }

    /// Waits for a frame or a command and deals with all that have come; returns after `patience` at the latest.
    ///
    /// # Errors
    /// The channels have broken down.
    pub fn step(&mut self, patience: Duration) -> Result<(), ServeError> {
        let ready = self.group.wait(Wait::Block { timeout: patience })?;
        // Commands first: those that were put before a frame must be known when it is looked at.
        self.receive_commands()?;
        if let Some(finger) = ready
            && finger < self.fingers.len()
        {
            let before = (self.allocations)();
            // Not for ever, however fast a driver puts.
            for _ in 0..MAX_FRAMES {
                let Some(frame) = self.skins[finger].try_get()? else {
                    break;
                };
                self.receive_commands()?;
                // Another host's clock says nothing here.
                let put_ns = match frame.header().remote {
                    0 => frame.header().put_ns,
                    _ => now_ns(),
                };
                self.follow_waiting(put_ns, Some(finger))?;
                self.frame(finger, &frame, put_ns)?;
            }
            self.counters.allocations += (self.allocations)() - before;
            // Who looks on since this frame is met now, not when the next belief is due.
            self.beliefs.update_connections()?;
            self.status.update_connections()?;
        } else if ready.is_none() {
            // The skin is silent: nothing that a command could come too early for.
            self.follow_waiting(u64::MAX, None)?;
        }
        let now = now_ns();
        if now.saturating_sub(self.alive_ns) >= ALIVE_EVERY_NS {
            self.model.send_history()?;
            self.publish_status(Event::Alive, 0, format_args!(""))?;
            self.keep_connections(now)?;
        }
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
        finger.framed_ns = put_ns;
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
        self.measures.count(&self.counters);
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
                let finger = &mut self.fingers[number];
                if let Some(sweep) = finger.segmenter.window().sweep() {
                    finger.recent.keep(sweep);
                }
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
        self.untold.0 += 1;
        self.untold.1 = StatusLine::default();
        let sweep = self.fingers[number].sweep;
        self.untold
            .1
            .write(format_args!("sweep {sweep} rejected: {reject}"));
        self.publish_status(Event::Rejected, number as u32, format_args!("{reject}"))
    }

    fn publish_status(
        &mut self,
        event: Event,
        finger: u32,
        text: std::fmt::Arguments<'_>,
    ) -> Result<(), ServeError> {
        let mut line = StatusLine::<192>::default();
        line.write(text);
        let (sweep, motion) = self
            .fingers
            .get(finger as usize)
            .map_or((0, 0), |finger| (finger.sweep, finger.motion));
        self.status.put_copy(&[TactileStatus {
            event: event as u32,
            finger,
            sweep,
            motion,
            model_version: self.names.version,
            counters: self.counters,
            text: Text::new(line.as_str()),
        }])?;
        self.alive_ns = now_ns();
        Ok(())
    }
}

impl Finger {
    /// Hands the classifier the rows of the window that it has not seen.
    fn catch_up(&mut self) {
        let window = self.segmenter.window();
        while self.taken < window.kept() {
            self.classifier.push(window.row(self.taken));
            self.taken += 1;
        }
    }
}
