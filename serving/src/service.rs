//! The service: frames and commands in, beliefs and status out.
//!
//! ```text
//! skin/<finger> ──> SweepFollower ──> OnlineClassifier ──> tactile/belief
//! sweep/command ──┘        └──────── events, counters ───> tactile/status
//!                   Workshop (a thread): new versions, enrolment ──> swapped in between sweeps
//! ```
//!
//! One thread, no clock but the channels' own. While frames come nothing is allocated, and the only system calls are the waits and wake-ups of the channels.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use tactnet_channel::{
    Bus, GetPort, GetSide, Priority, PutPort, Received, Start, SyncGroup, Wait, now_ns,
};
use tactnet_data::Frame;
use tactnet_models::{entropy, first_largest};
use tactnet_pipeline::OnlineClassifier;

use crate::follow::{Followed, Reject, Segmentation, SweepFollower};
use crate::line::Line;
use crate::measures::Measures;
use crate::model::{ModelSource, ServedModel};
use crate::packets::{
    Command, Counters, Event, MOST_MATERIALS, ModelNames, SkinFrame, Stage, SweepCommand,
    TactileBelief, TactileStatus, Text, Verdict,
};
use crate::workshop::{Job, News, Workshop};
use crate::{ServeConfig, ServeError};

/// Status is put at least this often.
const ALIVE_EVERY_NS: u64 = 100_000_000;
/// Frames of a finger in one go.
const MOST_FRAMES: usize = 256;
/// Commands that wait for their frame.
const WAITING: usize = 32;
/// Most fingers of a service.
pub(crate) const MOST_FINGERS: usize = 16;
/// Whole sweeps of a finger that are kept to learn from.
const KEPT_SWEEPS: usize = 20;

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
    /// With the time they were put at, in that order.
    waiting: VecDeque<(u64, SweepCommand)>,
    counters: Counters,
    measures: Arc<Measures>,
    sweeps: u64,
    lost_commands: u64,
    alive_ns: u64,
    workshop: Workshop,
    news: Option<News>,
    /// Classifiers that have served, on their way to the workshop.
    retired: Option<Vec<OnlineClassifier>>,
    /// Allocations of this thread so far.
    allocations: fn() -> u64,
}

struct Finger {
    follower: SweepFollower,
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

/// The newest whole sweeps.
struct RecentSweeps {
    /// `[KEPT_SWEEPS][values]`
    digits: Vec<f32>,
    values: usize,
    came: usize,
}

impl RecentSweeps {
    fn new(values: usize) -> Self {
        Self {
            digits: vec![0.0; KEPT_SWEEPS * values],
            values,
            came: 0,
        }
    }

    fn keep(&mut self, sweep: &[f32]) {
        let at = self.came % KEPT_SWEEPS * self.values;
        self.digits[at..at + self.values].copy_from_slice(sweep);
        self.came += 1;
    }

    /// The newest `sweeps`, or `None` where there are not so many.
    fn newest(&self, sweeps: usize) -> Option<Vec<f32>> {
        if sweeps == 0 || sweeps > self.came.min(KEPT_SWEEPS) {
            return None;
        }
        let mut digits = Vec::with_capacity(sweeps * self.values);
        for number in self.came - sweeps..self.came {
            let at = number % KEPT_SWEEPS * self.values;
            digits.extend_from_slice(&self.digits[at..at + self.values]);
        }
        Some(digits)
    }
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
        let (version, path) = source.newest()?;
        let served = ServedModel::load(&path, version)?;
        let names = Box::new(served.names(config.runs));
        let measures = Arc::<Measures>::default();
        measures.serve(Some(&path.display().to_string()), version);
        let shape = served.classifier().config().shape;
        let fingers = config.fingers.iter().map(|_| {
            Ok(Finger {
                follower: SweepFollower::new(
                    config.follow,
                    shape.steps,
                    shape.taxels(),
                    names.sample_rate_hz,
                ),
                classifier: served.online(config.runs)?,
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
            waiting: VecDeque::with_capacity(WAITING),
            counters: Counters::default(),
            measures,
            sweeps: 0,
            lost_commands: 0,
            alive_ns: 0,
            workshop: Workshop::start(served, source, &config, git)?,
            news: None,
            retired: None,
            allocations: || 0,
            config,
        };
        service.model.put_copy(&[*service.names])?;
        service.tell(Event::Swapped, 0, format_args!("version {version} serves"))?;
        Ok(service)
    }

    /// Counts allocations while frames are followed.
    ///
    /// - `allocations`: of the calling thread, since it began
    pub fn count_allocations(&mut self, allocations: fn() -> u64) {
        self.allocations = allocations;
    }

    /// Drops the frames and commands that came while the thread was being prepared, so that it begins with what happens now.
    ///
    /// # Errors
    /// The channels have broken down.
    pub fn forget_backlog(&mut self) -> Result<(), ServeError> {
        for skin in &self.skins {
            while skin.try_get()?.is_some() {}
        }
        // A sweep whose frames are gone must not begin.
        while self.commands.try_get()?.is_some() {}
        Ok(())
    }

    /// What it counts, to be read from other threads.
    pub fn measures(&self) -> Arc<Measures> {
        self.measures.clone()
    }

    /// The model that serves.
    pub fn names(&self) -> &ModelNames {
        &self.names
    }

    /// Whether it can tell unknown materials.
    pub fn tells_unknown(&self) -> bool {
        self.fingers
            .iter()
            .all(|finger| finger.classifier.tells_unknown())
    }

    /// Sequence of the first and the newest frame of every finger.
    pub fn sequences(&self) -> Vec<Option<(u64, u64)>> {
        self.fingers.iter().map(|finger| finger.sequences).collect()
    }

    /// Counters since the start.
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
            for _ in 0..MOST_FRAMES {
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
            self.beliefs.meet()?;
            self.status.meet()?;
        } else if ready.is_none() {
            // The skin is silent: nothing that a command could come too early for.
            self.follow_waiting(u64::MAX, None)?;
        }
        let now = now_ns();
        if now.saturating_sub(self.alive_ns) >= ALIVE_EVERY_NS {
            self.model.welcome()?;
            self.tell(Event::Alive, 0, format_args!(""))?;
        }
        self.take_news()
    }

    fn receive_commands(&mut self) -> Result<(), ServeError> {
        for _ in 0..WAITING {
            let Some(command) = self.commands.try_get()? else {
                break;
            };
            let header = *command.header();
            // Another host's clock says nothing here.
            let put_ns = if header.remote == 1 { 0 } else { header.put_ns };
            if let Some(command) = command.first() {
                if self.waiting.len() == WAITING {
                    self.tell(
                        Event::Refused,
                        command.finger,
                        format_args!("more than {WAITING} commands wait"),
                    )?;
                    continue;
                }
                // Several commanders are looked at in turns, not in the order of time.
                let at = self.waiting.partition_point(|(other, _)| *other <= put_ns);
                self.waiting.insert(at, (put_ns, *command));
            }
        }
        let lost = self.commands.lost();
        if lost > self.lost_commands {
            let more = lost - self.lost_commands;
            self.lost_commands = lost;
            self.tell(Event::Refused, 0, format_args!("{more} commands were lost"))?;
        }
        Ok(())
    }

    /// Follows the commands that were put until then, so that a command divides the frames at its own time, whenever it is seen.
    ///
    /// - `finger`: only its own, and those of no finger; `None`: all
    fn follow_waiting(&mut self, until_ns: u64, finger: Option<usize>) -> Result<(), ServeError> {
        let mut at = 0;
        while let Some((put_ns, command)) = self.waiting.get(at)
            && *put_ns <= until_ns
        {
            let command = *command;
            let other = command.finger as usize;
            if finger.is_some_and(|own| own != other && other < self.fingers.len()) {
                at += 1;
                continue;
            }
            self.waiting.remove(at);
            self.command(&command)?;
        }
        Ok(())
    }

    fn command(&mut self, command: &SweepCommand) -> Result<(), ServeError> {
        let number = command.finger;
        let by_contact = self.config.follow.segmentation != Segmentation::Command;
        let Some(finger) = self.fingers.get_mut(number as usize) else {
            return self.tell(
                Event::Refused,
                number,
                format_args!(
                    "no finger {number}; there are {}",
                    self.config.fingers.len()
                ),
            );
        };
        match command.command() {
            Some(Command::Start | Command::Stop) if by_contact => self.tell(
                Event::Refused,
                number,
                format_args!("sweeps begin and end by contact"),
            ),
            Some(Command::Start) => {
                let followed = finger.follower.start();
                if let Followed::RejectedAndBegun(reject) = followed {
                    self.reject(number as usize, &reject)?;
                }
                self.begin(number as usize, command.motion)
            }
            Some(Command::Stop) => {
                let followed = finger.follower.stop();
                self.followed(number as usize, followed, 0, 0)
            }
            Some(Command::Reset) => {
                finger.classifier.reset();
                finger.recent.came = 0;
                self.tell(Event::Reset, number, format_args!("fused sweeps forgotten"))
            }
            Some(Command::Enroll) => self.enroll(number, command),
            None => {
                let kind = command.kind;
                self.tell(Event::Refused, number, format_args!("no command {kind}"))
            }
        }
    }

    fn enroll(&mut self, number: u32, command: &SweepCommand) -> Result<(), ServeError> {
        let recent = &self.fingers[number as usize].recent;
        let kept = recent.came.min(KEPT_SWEEPS);
        let (material, sweeps) = (command.material, command.sweeps);
        if material.as_str().is_empty() {
            return self.tell(Event::Refused, number, format_args!("enrol: no name"));
        }
        let Some(digits) = recent.newest(sweeps as usize) else {
            return self.tell(
                Event::Refused,
                number,
                format_args!(
                    "enrol `{}`: {sweeps} sweeps asked for, {kept} are kept",
                    material.as_str()
                ),
            );
        };
        if self
            .workshop
            .ask(Job::Enroll {
                finger: number,
                material,
                digits,
            })
            .is_err()
        {
            return self.tell(
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
        let followed = finger.follower.push(&Frame {
            sequence: frame.sequence,
            sensor_time_nanos: frame.sensor_time_ns,
            taxels: frame.values(),
        });
        self.followed(number, followed, frame.sequence, put_ns)?;
        self.counters.frames += 1;
        self.counters.dropped_frames = self.skins.iter().map(GetPort::lost).sum();
        let delay = now_ns().saturating_sub(put_ns);
        self.counters.worst_delay_ns = self.counters.worst_delay_ns.max(delay);
        self.measures.count(&self.counters);
        Ok(())
    }

    fn followed(
        &mut self,
        number: usize,
        followed: Followed,
        sequence: u64,
        put_ns: u64,
    ) -> Result<(), ServeError> {
        match followed {
            Followed::Nothing => Ok(()),
            Followed::Begun => self.begin(number, 0),
            Followed::Rejected(reject) => self.reject(number, &reject),
            Followed::RejectedAndBegun(reject) => {
                self.reject(number, &reject)?;
                self.begin(number, 0)
            }
            Followed::Grown => {
                let finger = &mut self.fingers[number];
                finger.catch_up();
                let due = self.config.anytime_ms > 0.0 && finger.taken >= finger.next_belief;
                if !due || finger.taken == 0 {
                    return Ok(());
                }
                let every = self.config.anytime_ms / 1e3 * self.names.sample_rate_hz;
                finger.next_belief = finger.taken + (every.ceil() as usize).max(1);
                self.judge(number, Stage::Anytime, sequence, put_ns)
            }
            Followed::Complete => {
                let finger = &mut self.fingers[number];
                finger.catch_up();
                self.judge(number, Stage::Plain, sequence, put_ns)?;
                if self.config.runs > 0 {
                    self.judge(number, Stage::Dropout, sequence, put_ns)?;
                }
                let finger = &mut self.fingers[number];
                if let Some(sweep) = finger.follower.window().sweep() {
                    finger.recent.keep(sweep);
                }
                self.counters.sweeps += 1;
                self.tell(Event::Judged, number as u32, format_args!(""))
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
        self.tell(Event::Begun, number as u32, format_args!(""))
    }

    fn reject(&mut self, number: usize, reject: &Reject) -> Result<(), ServeError> {
        self.counters.rejected += 1;
        self.tell(Event::Rejected, number as u32, format_args!("{reject}"))
    }

    /// Judges what the finger has felt of its sweep, and puts the belief.
    fn judge(
        &mut self,
        number: usize,
        stage: Stage,
        sequence: u64,
        put_ns: u64,
    ) -> Result<(), ServeError> {
        let begun = now_ns();
        let finger = &mut self.fingers[number];
        let last = match stage {
            Stage::Anytime => false,
            Stage::Plain => self.config.runs == 0,
            Stage::Dropout => true,
        };
        let mut packet = self.beliefs.loan(1)?;
        let out = &mut packet[0];
        let belief = match stage {
            Stage::Dropout => finger.classifier.judge_by_dropout(),
            Stage::Anytime | Stage::Plain => finger.classifier.judge(),
        };
        let log_p = belief.log_probability;
        let verdict = match belief.unknown {
            None => Verdict::NotTold,
            Some(false) => Verdict::Known,
            Some(true) => Verdict::Unknown,
        };
        *out = bytemuck::Zeroable::zeroed();
        out.materials = log_p.len() as u32;
        out.label = first_largest(log_p) as u32;
        out.verdict = verdict as u32;
        out.entropy = belief.entropy as f32;
        out.strangeness = belief.strangeness.unwrap_or(0.0) as f32;
        out.threshold = belief.threshold.unwrap_or(0.0) as f32;
        for (out, log_p) in out.posterior.iter_mut().zip(log_p) {
            *out = log_p.exp() as f32;
        }
        // What is unknown must not count for one of the known materials.
        if last && verdict != Verdict::Unknown {
            finger.classifier.fuse();
        }
        let fused = finger.classifier.fused();
        let mut probabilities = [0.0; MOST_MATERIALS];
        let probabilities = &mut probabilities[..out.materials as usize];
        fused.probabilities_into(probabilities);
        out.fused_sweeps = fused.sweeps() as u32;
        out.fused_label = first_largest(probabilities) as u32;
        for (out, p) in out.fused.iter_mut().zip(probabilities.iter()) {
            *out = *p as f32;
        }
        probabilities.iter_mut().for_each(|p| *p = p.ln());
        out.fused_entropy = entropy(probabilities) as f32;
        out.sweep = finger.sweep;
        out.motion = finger.motion;
        out.model_version = self.names.version;
        out.last_frame = sequence;
        out.stage = stage as u32;
        out.finger = number as u32;
        out.frames = finger.taken as u32;
        out.filled_in = finger.follower.window().filled_in() as u32;
        let now = now_ns();
        out.latency_ns = now.saturating_sub(put_ns);
        let (latency, whole) = (out.latency_ns, stage != Stage::Anytime);
        self.beliefs.put(packet)?;
        self.counters.beliefs += 1;
        if last && verdict == Verdict::Unknown {
            self.counters.unknown += 1;
        }
        let deadline_ms = match stage {
            Stage::Dropout => self.config.dropout_deadline_ms,
            Stage::Anytime | Stage::Plain => self.config.plain_deadline_ms,
        };
        if whole && latency as f64 > 1e6 * deadline_ms {
            self.counters.deadline_misses += 1;
        }
        self.measures.judged(stage, now - begun);
        Ok(())
    }

    fn take_news(&mut self) -> Result<(), ServeError> {
        // Freeing memory is the workshop's; it may be busy for a while.
        if let Some(classifiers) = self.retired.take()
            && let Err(Job::Retire(classifiers)) = self.workshop.ask(Job::Retire(classifiers))
        {
            self.retired = Some(classifiers);
        }
        if self.news.is_none() {
            self.news = self.workshop.news();
        }
        // Models change between sweeps only.
        let sweeping = self.fingers.iter().any(|f| f.follower.is_sweeping());
        match &self.news {
            None => return Ok(()),
            Some(News::Ready { .. }) if sweeping || self.retired.is_some() => return Ok(()),
            Some(_) => {}
        }
        match self.news.take() {
            Some(News::Ready {
                mut classifiers,
                names,
                event,
                finger: asked,
                text,
            }) => {
                let mut forgotten = [false; MOST_FINGERS];
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
                self.tell(event, asked, format_args!("{}", text.as_str()))?;
                for (number, forgotten) in forgotten.into_iter().enumerate() {
                    if forgotten {
                        let text = format_args!("fused sweeps forgotten: other materials");
                        self.tell(Event::Reset, number as u32, text)?;
                    }
                }
                Ok(())
            }
            Some(News::Failed {
                event,
                finger,
                text,
            }) => self.tell(event, finger, format_args!("{}", text.as_str())),
            None => Ok(()),
        }
    }

    fn tell(
        &mut self,
        event: Event,
        finger: u32,
        text: std::fmt::Arguments<'_>,
    ) -> Result<(), ServeError> {
        let mut line = Line::<192>::default();
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
    /// Gives the classifier the rows of the window that it has not seen.
    fn catch_up(&mut self) {
        let window = self.follower.window();
        while self.taken < window.kept() {
            self.classifier.push(window.row(self.taken));
            self.taken += 1;
        }
    }
}
