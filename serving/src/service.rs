//! The service: frames and commands in, beliefs and status out.
//!
//! ```text
//! skin/<finger> ──> SweepSegmenter ──> OnlineClassifier ──> tactile/belief
//! sweep/command ──┘        └──────── events, counters ───> tactile/status
//!                   ModelWorker (a thread): new versions, enrolment ──> swapped in between sweeps
//! ```
//!
//! One thread, no clock but the channels' own. While frames come nothing is allocated, and the only system calls are the waits and wake-ups of the channels.

mod predict;
mod recent_sweeps;
mod waiting_commands;

use std::sync::Arc;
use std::time::Duration;

use tactnet_channel::{
    Bus, GetPort, GetSide, Priority, PutPort, Received, Start, SyncGroup, Wait, now_ns,
};
use tactnet_data::Frame;
use tactnet_pipeline::OnlineClassifier;

use crate::ServeError;
use crate::measures::Measures;
use crate::model::ModelSource;
use crate::model_worker::{Job, ModelWorker, WorkerEvent};
use crate::status_line::StatusLine;
use recent_sweeps::RecentSweeps;
use tactnet_skin::packets::{
    Command, Counters, Event, ModelNames, SkinFrame, Stage, SweepCommand, TactileBelief,
    TactileStatus, Text,
};
use tactnet_skin::{MAX_FINGERS, Reject, Segmentation, ServeConfig, SweepChange, SweepSegmenter};
use waiting_commands::{MAX_COMMANDS, WaitingCommands};

/// Status is put at least this often.
const ALIVE_EVERY_NS: u64 = 100_000_000;
/// Frames of a finger in one go.
const MAX_FRAMES: usize = 256;

/// The classifier on its channels.
pub struct Service {
    config: ServeConfig,
    group: SyncGroup,
    skins: Vec<GetPort<SkinFrame>>,
    commands: GetPort<SweepCommand>,
    beliefs: PutPort<TactileBelief>,
    status: PutPort<TactileStatus>,
    model: PutPort<ModelNames>,
    names: Box<ModelNames>,
    fingers: Vec<Finger>,
    waiting: WaitingCommands,
    counters: Counters,
    measures: Arc<Measures>,
    sweeps: u64,
    lost_commands: u64,
    alive_ns: u64,
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
        measures.serve(Some(&served.path().display().to_string()), version);
        let shape = served.classifier().config().shape;
        let fingers = config.fingers.iter().map(|_| {
            Ok(Finger {
                segmenter: SweepSegmenter::new(
                    config.segmenter,
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
            group,
            skins,
            commands,
            beliefs: bus.put_port(config.belief.as_str(), Priority::High)?,
            status: bus.put_port(config.status.as_str(), Priority::Normal)?,
            model: bus.put_port(config.model.as_str(), Priority::Normal)?,
            names,
            fingers,
            waiting: WaitingCommands::new(config.fingers.len()),
            counters: Counters::default(),
            measures,
            sweeps: 0,
            lost_commands: 0,
            alive_ns: 0,
            worker: ModelWorker::start(served, source, &config, git)?,
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
        }
        self.apply_worker_event()
    }

    fn receive_commands(&mut self) -> Result<(), ServeError> {
        for _ in 0..MAX_COMMANDS {
            let Some(command) = self.commands.try_get()? else {
                break;
            };
            let header = *command.header();
            // Another host's clock says nothing here.
            let put_ns = if header.remote == 1 { 0 } else { header.put_ns };
            if let Some(command) = command.first()
                && !self.waiting.add(put_ns, *command)
            {
                self.publish_status(
                    Event::Refused,
                    command.finger,
                    format_args!(
                        "more than {MAX_COMMANDS} commands wait for frames of this finger"
                    ),
                )?;
            }
        }
        let lost = self.commands.lost();
        if lost > self.lost_commands {
            let more = lost - self.lost_commands;
            self.lost_commands = lost;
            self.publish_status(Event::Refused, 0, format_args!("{more} commands were lost"))?;
        }
        Ok(())
    }

    /// Follows the commands that were put until then, so that a command divides the frames at its own time, whenever it is seen.
    fn follow_waiting(&mut self, until_ns: u64, finger: Option<usize>) -> Result<(), ServeError> {
        while let Some(command) = self.waiting.take(until_ns, finger) {
            self.command(&command)?;
        }
        Ok(())
    }

    fn command(&mut self, command: &SweepCommand) -> Result<(), ServeError> {
        let number = command.finger;
        let by_contact = self.config.segmenter.segmentation != Segmentation::Command;
        let Some(finger) = self.fingers.get_mut(number as usize) else {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!(
                    "no finger {number}; there are {}",
                    self.config.fingers.len()
                ),
            );
        };
        match command.command() {
            Some(Command::Start | Command::Stop) if by_contact => self.publish_status(
                Event::Refused,
                number,
                format_args!("sweeps begin and end by contact"),
            ),
            Some(Command::Start) => {
                let change = finger.segmenter.start();
                if let SweepChange::RejectedAndBegun(reject) = change {
                    self.reject(number as usize, &reject)?;
                }
                self.begin(number as usize, command.motion)
            }
            Some(Command::Stop) => {
                let change = finger.segmenter.stop();
                self.apply_change(number as usize, change, 0, 0)
            }
            Some(Command::Reset) => {
                finger.classifier.reset();
                finger.recent.forget();
                self.publish_status(Event::Reset, number, format_args!("fused sweeps forgotten"))
            }
            Some(Command::Enroll) => self.enroll(number, command),
            None => {
                let kind = command.kind;
                self.publish_status(Event::Refused, number, format_args!("no command {kind}"))
            }
        }
    }

    fn enroll(&mut self, number: u32, command: &SweepCommand) -> Result<(), ServeError> {
        let recent = &self.fingers[number as usize].recent;
        let kept = recent.kept();
        let (material, sweeps) = (command.material, command.sweeps);
        if material.as_str().is_empty() {
            return self.publish_status(Event::Refused, number, format_args!("enrol: no name"));
        }
        let Some(digits) = recent.newest(sweeps as usize) else {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!(
                    "enrol `{}`: {sweeps} sweeps asked for, {kept} are kept",
                    material.as_str()
                ),
            );
        };
        if self
            .worker
            .ask(Job::Enroll {
                finger: number,
                material,
                digits,
            })
            .is_err()
        {
            return self.publish_status(
                Event::Refused,
                number,
                format_args!("enrol `{}`: busy, try again", material.as_str()),
            );
        }
        Ok(())
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
        self.publish_status(Event::Rejected, number as u32, format_args!("{reject}"))
    }

    fn apply_worker_event(&mut self) -> Result<(), ServeError> {
        // The worker frees memory; it may be busy for a while.
        if let Some(classifiers) = self.retired.take()
            && let Err(Job::Retire(classifiers)) = self.worker.ask(Job::Retire(classifiers))
        {
            self.retired = Some(classifiers);
        }
        if self.worker_event.is_none() {
            self.worker_event = self.worker.next_event();
        }
        // Models change between sweeps only.
        let sweeping = self.fingers.iter().any(|f| f.segmenter.is_sweeping());
        match &self.worker_event {
            None => return Ok(()),
            Some(WorkerEvent::Ready { .. }) if sweeping || self.retired.is_some() => return Ok(()),
            Some(_) => {}
        }
        match self.worker_event.take() {
            Some(WorkerEvent::Ready {
                mut classifiers,
                names,
                event,
                finger: asked,
                text,
            }) => {
                let mut forgotten = [false; MAX_FINGERS];
                let fingers = self.fingers.iter_mut().zip(&mut classifiers);
                for ((finger, classifier), forgotten) in fingers.zip(&mut forgotten) {
                    std::mem::swap(&mut finger.classifier, classifier);
                    // Beliefs over other materials cannot go on.
                    *forgotten = !finger.classifier.take_fused(classifier)
                        && classifier.fused().sweeps() > 0;
                }
                self.names = names;
                self.measures.serve(None, self.names.version);
                self.retired = Some(classifiers);
                self.model.put_copy(&[*self.names])?;
                self.publish_status(event, asked, format_args!("{}", text.as_str()))?;
                for (number, forgotten) in forgotten.into_iter().enumerate() {
                    if forgotten {
                        let text = format_args!("fused sweeps forgotten: other materials");
                        self.publish_status(Event::Reset, number as u32, text)?;
                    }
                }
                Ok(())
            }
            Some(WorkerEvent::Failed {
                event,
                finger,
                text,
            }) => self.publish_status(event, finger, format_args!("{}", text.as_str())),
            None => Ok(()),
        }
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
