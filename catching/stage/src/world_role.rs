//! The simulated world in real time: takes commands of joints and hands, and publishes sensor data.

use std::collections::VecDeque;
use std::sync::mpsc::{Sender, SyncSender, TrySendError, channel, sync_channel};

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    CatchPhase, CatchStatus, Circles, FeltMaterial, HandCommand, HandOpening, HandState, ImuSample,
    JointCommand, JointState, MarkerFeature, MarkerFeatures, ThrowPath,
};
use tactnet_catching_roles::{RoleSettings, channels, drain};
use tactnet_catching_world::{FlightSample, TICK_NS, World};
use tactnet_channel::{Bus, GetPort, PutPort, Ticker};

use crate::StageError;
use crate::drive_watch::DriveWatch;
use crate::hands::{Held, Letting};
use crate::judge::{Judged, Over, judge};
use crate::painter::{Exposure, paint};
use crate::world_settings::{SlipAt, WorldSettings, material_of_grip};

/// Delay between a controller cycle and the tick at which the drives take its command, in ns.
const AFTER_BEAT_NS: u64 = 500_000;
/// Maximum duration of a flight, after which the next throw may start, in ns.
const LONGEST_NS: u64 = 3_200_000_000;

/// Timeout after which a hand drops a ball that is not explored or thrown, in ns.
const LONGEST_HELD_NS: u64 = 30_000_000_000;
/// Number of ticks between two packets about the hands.
const HAND_STATE_EVERY: u64 = 20;

/// Process of the world.
#[derive(Debug, Clone)]
pub struct WorldRole {
    /// Settings.
    pub settings: WorldSettings,
}

/// Statistics of the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldReport {
    /// Number of throws.
    pub throws: u64,
    /// Number of ticks.
    pub ticks: u64,
    /// Number of ticks that were more than 1 ms late.
    pub late_ticks: u64,
    /// Number of brakings of the drives because commands were missing while joints moved.
    pub drives_braked: u64,
    /// Number of exposures that were skipped because the painter was busy.
    pub undrawn: u64,
    /// Number of pictures that were rendered too late.
    pub late_pictures: u64,
}

struct Ports {
    commands: GetPort<JointCommand>,
    targets: GetPort<HandCommand>,
    status: GetPort<CatchStatus>,
    felt: GetPort<FeltMaterial>,
    openings: GetPort<HandOpening>,
    throws: GetPort<ThrowPath>,
    hands: PutPort<HandState>,
    joints: PutPort<JointState>,
    imu: PutPort<ImuSample>,
    /// Present if no pictures are rendered.
    detected: Option<DetectedPorts>,
}

/// Detections in the pictures of an exposure.
struct Detected {
    circles: [Circles; 2],
    markers: MarkerFeatures,
}

struct DetectedPorts {
    circles: PutPort<Circles>,
    markers: PutPort<MarkerFeatures>,
}

impl Ports {
    /// Opens the ports.
    ///
    /// - `pixels`: true if pictures are rendered
    fn open(bus: &Bus, pixels: bool) -> Result<Self, StageError> {
        Ok(Self {
            commands: channels::JOINT_COMMAND.get(bus)?,
            targets: channels::HAND_TARGET.get(bus)?,
            status: channels::CATCH_STATE.get(bus)?,
            felt: channels::CATCH_FELT.get(bus)?,
            openings: channels::HAND_OPEN.get(bus)?,
            throws: channels::THROW_PATH.get(bus)?,
            hands: channels::HAND_STATE.put(bus)?,
            joints: channels::JOINT_STATE.put(bus)?,
            imu: channels::IMU.put(bus)?,
            detected: match pixels {
                true => None,
                false => Some(DetectedPorts {
                    circles: channels::CIRCLES.put(bus)?,
                    markers: channels::MARKER_FEATURES.put(bus)?,
                }),
            },
        })
    }
}

impl WorldRole {
    /// Opens the ports, calls `ready`, and runs until `stopped` returns true.
    ///
    /// # Errors
    /// Missing or broken channels, and invalid settings.
    pub fn run(
        &self,
        bus: &Bus,
        ready: &dyn Fn(),
        stopped: &dyn Fn() -> bool,
    ) -> Result<WorldReport, StageError> {
        let stack = RoleSettings::of(bus.table())?;
        let robot = stack.robot()?;
        let start = robot.waiting();
        let settings = &self.settings;
        if let Some(slip) = &settings.slip {
            slip.tendon.check()?;
        }
        let world = World::new(robot.description(), &settings.world, settings.seed, &start)?;
        let ports = Ports::open(bus, settings.pixels)?;
        std::thread::scope(|scope| {
            let (over, throws) = channel::<Judged>();
            let (judge_robot, lower_body) = (&robot, stack.coordinator.lower_body);
            let judged = scope.spawn(move || judge(bus, judge_robot, &start, lower_body, &throws));
            let painting = settings.pixels.then(|| {
                let (exposures, moments) = sync_channel::<Exposure>(1);
                let (robot, world, seed) = (robot.description(), &settings.world, settings.seed);
                let painter = scope.spawn(move || paint(bus, robot, world, seed, &moments));
                (exposures, painter)
            });
            let (exposures, painted) = painting.unzip();
            ready();
            let mut live = LiveWorld {
                drives: DriveWatch::new(*robot.joints(), &start),
                world,
                settings,
                ports,
                over,
                exposures,
                report: WorldReport::default(),
                epoch_ns: 0,
                detected: VecDeque::new(),
                phase: (CatchPhase::Starting, 0),
                thrown_ns: None,
                grips: 0,
                held: None,
                letting: Letting::default(),
                judged: 0,
                flights: Vec::new(),
                balls: 0,
                frames: 0,
            };
            let ran = live.run(stopped);
            let mut report = live.report;
            report.drives_braked = live.drives.braked;
            // Dropping the senders ends judge and painter.
            drop(live);
            if let Some(painter) = painted {
                report.late_pictures = joined(painter)?;
            }
            joined(judged)?;
            ran.map(|()| report)
        })
    }
}

fn joined<T>(
    thread: std::thread::ScopedJoinHandle<'_, Result<T, StageError>>,
) -> Result<T, StageError> {
    thread
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

struct LiveWorld<'a> {
    world: World,
    drives: DriveWatch,
    settings: &'a WorldSettings,
    ports: Ports,
    over: Sender<Judged>,
    exposures: Option<SyncSender<Exposure>>,
    report: WorldReport,
    /// Offset from the world's time to the host's, in ns.
    epoch_ns: u64,
    /// Pending detections, with their time of arrival in ns.
    detected: VecDeque<(u64, Detected)>,
    /// Phase of the robot, and the time of its start in ns.
    phase: (CatchPhase, u64),
    thrown_ns: Option<u64>,
    /// Number of caught balls.
    grips: u64,
    held: Option<Held>,
    letting: Letting,
    judged: usize,
    /// Number and flight of each ball of the last throw.
    flights: Vec<(u64, Vec<FlightSample>)>,
    balls: u64,
    frames: u64,
}

impl LiveWorld<'_> {
    fn run(&mut self, stopped: &dyn Fn() -> bool) -> Result<(), StageError> {
        let mut ticker = Ticker::aligned(1000.0, AFTER_BEAT_NS);
        self.epoch_ns = ticker.next_ns() - TICK_NS;
        while !stopped() {
            let late = ticker.wait();
            self.report.ticks += 1;
            self.report.late_ticks += u64::from(late > TICK_NS);
            self.tick()?;
        }
        Ok(())
    }

    fn now_ns(&self) -> u64 {
        self.world.time_ns() + self.epoch_ns
    }

    fn tick(&mut self) -> Result<(), StageError> {
        let mut newest = None;
        drain(&self.ports.commands, |command| newest = Some(*command))?;
        let mut hands = [None; ARMS];
        drain(&self.ports.targets, |target| {
            if let Some(hand) = hands.get_mut(target.arm as usize) {
                *hand = Some(HandCommand {
                    arm: target.arm,
                    catch_ns: target.catch_ns.saturating_sub(self.epoch_ns),
                });
            }
        })?;
        drain(&self.ports.status, |status| {
            let phase = status.phase().unwrap_or(CatchPhase::Starting);
            self.phase = (phase, status.since_ns);
        })?;
        drain(&self.ports.throws, |path| self.letting.path = Some(*path))?;
        drain(&self.ports.openings, |told| {
            self.world.tell_opening(&HandOpening {
                open_ns: told.open_ns.saturating_sub(self.epoch_ns),
                ..*told
            });
        })?;
        self.throw()?;
        let command = *self.drives.tick(newest.as_ref());
        let sensed = *self.world.step(&command, &hands);
        let epoch_ns = self.epoch_ns;
        self.ports.joints.put_copy(&[JointState {
            sensor_ns: sensed.joints.sensor_ns + epoch_ns,
            ..sensed.joints
        }])?;
        if let Some(sample) = sensed.imu {
            self.ports.imu.put_copy(&[ImuSample {
                sensor_ns: sample.sensor_ns + epoch_ns,
                ..sample
            }])?;
        }
        if let Some(circles) = sensed.circles {
            self.see(circles);
        }
        self.deliver()?;
        self.judge();
        if let Some(thrown) = self.letting.follow(&mut self.world, self.epoch_ns) {
            let _ = self.over.send(Judged::Thrown(Box::new(thrown)));
        }
        self.feel()?;
        Ok(())
    }

    /// Throws balls once the robot has waited long enough and the last ball is gone.
    fn throw(&mut self) -> Result<(), StageError> {
        let now = self.now_ns();
        let (phase, since) = self.phase;
        let rested = phase == CatchPhase::Armed
            && now.saturating_sub(since) > (self.settings.rest * 1e9) as u64;
        let free = self.held.is_none()
            && self.letting.away.is_none()
            && self
                .thrown_ns
                .is_none_or(|thrown| now > thrown + LONGEST_NS);
        if rested && free {
            let due = |slip: &&SlipAt| slip.throw == self.report.throws + 1;
            if let Some(slip) = self.settings.slip.as_ref().filter(due) {
                self.world.slip(&slip.tendon)?;
            }
            self.world.throw(self.settings.balls);
            self.thrown_ns = Some(now);
            self.report.throws += 1;
            // Computed while the robot waits, because it takes several milliseconds.
            let numbers = self.balls..self.balls + self.settings.balls as u64;
            self.balls = numbers.end;
            self.flights = numbers
                .filter_map(|ball| Some((ball, self.world.true_flight(ball)?)))
                .collect();
        }
        Ok(())
    }

    fn see(&mut self, mut circles: [Circles; 2]) {
        let exposure_ns = circles[0].exposure_ns + self.epoch_ns;
        for side in &mut circles {
            side.exposure_ns = exposure_ns;
        }
        let camera_ns = (self.settings.camera * 1e9) as u64;
        let Some(exposures) = &self.exposures else {
            let due_ns = exposure_ns + camera_ns + (self.settings.detection * 1e9) as u64;
            let [left, right] = self.world.marker_features();
            let markers = MarkerFeatures {
                frame: circles[0].frame,
                exposure_ns,
                left: left.map(MarkerFeature::of),
                right: right.map(MarkerFeature::of),
            };
            self.detected
                .push_back((due_ns, Detected { circles, markers }));
            return;
        };
        let frame = self.frames;
        self.frames += 1;
        let exposure = Exposure {
            truth: self.world.truth(),
            frame,
            exposure_ns,
            due_ns: exposure_ns + camera_ns,
        };
        if let Err(TrySendError::Full(_)) = exposures.try_send(exposure) {
            self.report.undrawn += 1;
        }
    }

    fn deliver(&mut self) -> Result<(), StageError> {
        let now = self.now_ns();
        let Some(ports) = &self.ports.detected else {
            return Ok(());
        };
        while let Some((_, detected)) = self.detected.pop_front_if(|(due, _)| *due <= now) {
            for side in detected.circles {
                ports.circles.put_copy(&[side])?;
            }
            ports.markers.put_copy(&[detected.markers])?;
        }
        Ok(())
    }

    /// Publishes the state of the hands, and drops balls that were explored.
    fn feel(&mut self) -> Result<(), StageError> {
        let now = self.now_ns();
        let mut felt = None;
        while let Some(packet) = self.ports.felt.try_get()? {
            let grips = self.grips;
            felt = packet.iter().find(|felt| felt.grip == grips).copied();
        }
        if let Some(held) = &mut self.held {
            let gone = now > held.until_ns || !self.world.holding()[held.arm];
            if let Some(mut over) = held.over.take_if(|_| felt.is_some() || gone) {
                over.felt = felt;
                let _ = self.over.send(Judged::Over(Box::new(over)));
                held.until_ns = now + LONGEST_HELD_NS;
            }
            let waits = held.over.is_some() || self.settings.throw_back;
            if gone || !waits {
                self.world.take(held.arm);
                self.held = None;
            }
        }
        if self.report.ticks.is_multiple_of(HAND_STATE_EVERY) {
            let held = self.held.as_ref();
            self.ports.hands.put_copy(&[HandState {
                t_ns: now,
                arm: held.map_or(0, |held| held.arm as u32),
                holds: u32::from(held.is_some()),
                grip: self.grips,
            }])?;
        }
        Ok(())
    }

    fn judge(&mut self) {
        while let Some(verdict) = self.world.verdicts().get(self.judged).copied() {
            self.judged += 1;
            let known = self
                .flights
                .iter()
                .position(|(ball, _)| *ball == verdict.ball);
            let flight = known.map_or_else(Vec::new, |place| self.flights.swap_remove(place).1);
            let mut over = Over {
                throw: self.report.throws,
                verdict,
                flight,
                epoch_ns: self.epoch_ns,
                material: None,
                felt: None,
            };
            if verdict.caught() {
                self.grips += 1;
                let materials = &self.settings.materials;
                let place = material_of_grip(self.settings.seed, self.grips, materials.len());
                over.material = place.map(|place| materials[place].clone());
            }
            // The judge runs as long as the world.
            let tell = |over: Over| drop(self.over.send(Judged::Over(Box::new(over))));
            let stays = verdict.caught() && self.settings.throw_back;
            if self.held.is_some() || !(over.material.is_some() || stays) {
                tell(over);
                continue;
            }
            let mut waits = Some(over);
            if let Some(over) = waits.take_if(|over| over.material.is_none()) {
                tell(over);
            }
            let crossing = verdict.crossing.as_ref();
            self.held = Some(Held {
                arm: crossing.map_or(0, |crossing| crossing.arm),
                until_ns: self.now_ns() + LONGEST_HELD_NS,
                over: waits,
            });
        }
    }
}
