//! The world: everything put together, tick by tick.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::packets::{
    Circles, HandCommand, ImuSample, JointCommand, JointState, MAX_BALLS,
};
use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription};

use crate::ball::{Aerodynamics, BALL_STEP, BallState};
use crate::cameras::{CAMERAS, Cameras};
use crate::config::WorldConfig;
use crate::contact::{Contacts, deepest, is_clear_of};
use crate::depth::DepthPicture;
use crate::drives::TICK;
use crate::error::{WorldError, within};
use crate::hand::Hand;
use crate::imu::Imu;
use crate::judge::{Crossings, HandDuring, Verdict};
use crate::obstacles::StandingBox;
use crate::release::{Held, OpenCommand, Released};
use crate::robot::{FrameMotion, Robot};
use crate::shape::{CAPSULES, Capsule, PlacedCapsule, capsules};
use crate::stream::Stream;

/// A tick, ns.
pub const TICK_NS: u64 = 1_000_000;
/// Steps of a ball in a tick.
const BALL_STEPS: usize = 10;
/// A ball is gone this long after it was thrown, ns, or farther behind the robot than [`BEHIND`].
const LONGEST_NS: u64 = 3_000_000_000;
/// m.
const BEHIND: f64 = -1.5;
/// Who puts a box somewhere keeps it so far from the robot, m.
const PUT_APART: f64 = 0.1;

/// What the robot senses in a tick; all at its end but the inertial sample, which carries its own time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// Every tick.
    pub joints: JointState,
    /// 512 times a second.
    pub imu: Option<ImuSample>,
    /// 25 times a second, left and right, at the moment of exposure: what cameras and detectors take to deliver is added by the caller.
    pub circles: Option<[Circles; CAMERAS]>,
}

/// A ball as it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallTruth {
    /// Its number, counted through the world's life.
    pub number: u64,
    /// Where it is.
    pub state: BallState,
}

/// A ball of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightSample {
    /// When, ns.
    pub t_ns: u64,
    /// Where.
    pub state: BallState,
}

/// What is, for judges, oracles and reports; never for the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// ns.
    pub time_ns: u64,
    /// Balls in the air, or bouncing; the earliest thrown first.
    pub balls: [Option<BallTruth>; MAX_BALLS],
    /// The head's frame.
    pub head: FrameMotion,
    /// The chest's frame.
    pub chest: FrameMotion,
    /// The catch frames: left, right.
    pub hands: [FrameMotion; ARMS],
    /// By how much the torso's links stand off their drives, rad: yaw, lower pitch, upper pitch.
    pub deflection: [f64; 3],
    /// By how much the platform stands off its drive, m.
    pub slip: f64,
}

/// Commands that changed nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ignored {
    /// Joint commands that were not all numbers.
    pub joints: u64,
    /// Hand commands for the past or another arm.
    pub hands: [u64; ARMS],
}

#[derive(Debug, Clone)]
struct Thrown {
    number: u64,
    air: Aerodynamics,
    release_ns: u64,
    release: BallState,
    /// Now; as released, before that.
    state: BallState,
    crossings: Crossings,
    phase: Phase,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// In the thrower's hand.
    Held,
    /// Not judged yet.
    Flying,
    /// Missed, still to be seen.
    Missed,
    /// Caught, or away.
    Gone,
}

/// A robot, balls, and time.
#[derive(Debug, Clone)]
pub struct World {
    config: WorldConfig,
    seed: u64,
    time_ns: u64,
    robot: Robot,
    hands: [Hand; ARMS],
    imu: Imu,
    cameras: Cameras,
    capsules: [Capsule; CAPSULES],
    boxes: Vec<StandingBox>,
    rearrangements: u64,
    contacts: Contacts,
    /// From where markers were to be to where they are, m, frames of the arms' last links.
    markers: [Vector3<f64>; ARMS],
    thrown: Vec<Thrown>,
    verdicts: Vec<Verdict>,
    /// Balls in hands.
    held: [Option<Held>; ARMS],
    releases: u64,
    released: Option<Released>,
    sensed: Sensed,
}

impl World {
    /// A robot that stands still at `start` (rad, m; all in their ranges), at time 0, without balls.
    ///
    /// # Errors
    /// Where a setting or a joint's start is out of range, where no throw gets to the thrower's box, and where the torso's springs do not
    /// carry the robot.
    pub fn new(
        description: &RobotDescription,
        config: &WorldConfig,
        seed: u64,
        start: &[f64; JOINTS],
    ) -> Result<Self, WorldError> {
        config.check()?;
        let a_tick = [f64::MIN_POSITIVE, 1.0 / TICK];
        let expected = "at most one in a tick, 1000 Hz";
        within(
            "description.imu.rate",
            description.imu.rate,
            a_tick,
            expected,
        )?;
        within(
            "description.cameras.rate",
            description.cameras.rate,
            a_tick,
            expected,
        )?;
        let robot = Robot::new(description, config, seed, start)?;
        let sensed = Sensed {
            joints: JointState {
                number: 0,
                sensor_ns: 0,
                q: *start,
                dq: [0.0; JOINTS],
                tau: robot.torques,
            },
            imu: None,
            circles: None,
        };
        let capsules = capsules(description);
        let boxes = config.obstacles.place(seed, 0, |standing| {
            is_clear_of(standing, &capsules, &robot.places, PUT_APART)
        });
        Ok(Self {
            hands: std::array::from_fn(Hand::new),
            imu: Imu::new(
                &config.imu,
                &config.errors,
                description.imu.rate,
                seed,
                robot.felt[0],
            ),
            markers: config.errors.markers(seed),
            cameras: Cameras::new(&config.cameras, &config.errors, &description.cameras, seed),
            config: config.clone(),
            seed,
            time_ns: 0,
            robot,
            capsules,
            boxes,
            rearrangements: 0,
            contacts: Contacts::default(),
            thrown: Vec::new(),
            verdicts: Vec::new(),
            held: [None; ARMS],
            releases: 0,
            released: None,
            sensed,
        })
    }

    /// Throws the first of `balls` balls now, each other one after the gap that is drawn for it; numbers go on from the last throw's.
    /// Missed balls that still roll about are taken away.
    ///
    /// # Panics
    /// If with these there would be more than [`MAX_BALLS`] that have no verdict yet.
    pub fn throw(&mut self, balls: usize) {
        self.take_away_missed(balls);
        let mut release_ns = self.time_ns;
        for ball in 0..balls {
            let number = self.thrown.len() as u64;
            let air =
                Aerodynamics::draw(&self.config.ball, &mut Stream::Ball.rng(self.seed, number));
            let (gap, release) = self
                .config
                .thrower
                .draw(&air, &mut Stream::Thrower.rng(self.seed, number));
            if ball > 0 {
                release_ns += (gap / TICK).round() as u64 * TICK_NS;
            }
            self.thrown.push(Thrown {
                number,
                air,
                release_ns,
                release,
                state: release,
                crossings: Crossings::default(),
                phase: Phase::Held,
            });
        }
        self.verdicts.reserve(self.thrown.len());
    }

    fn take_away_missed(&mut self, balls: usize) {
        for ball in &mut self.thrown {
            if ball.phase == Phase::Missed {
                ball.phase = Phase::Gone;
            }
        }
        let alive = self.thrown.iter().filter(|ball| ball.phase != Phase::Gone);
        assert!(
            alive.count() + balls <= MAX_BALLS,
            "at most {MAX_BALLS} balls at once"
        );
    }

    /// Puts a ball into an empty hand, its drag as drawn for the next ball's number. A ball that a hand catches is in it without that.
    ///
    /// # Errors
    /// Where there is no such arm, and where the hand holds a ball.
    pub fn give(&mut self, arm: usize) -> Result<(), WorldError> {
        let number = self.thrown.len() as u64;
        let air = Aerodynamics::draw(&self.config.ball, &mut Stream::Ball.rng(self.seed, number));
        let held = self.held.get_mut(arm).ok_or(WorldError::Arm { arm })?;
        if held.is_some() {
            return Err(WorldError::Hand {
                arm,
                expected: "nothing",
                found: "a ball",
            });
        }
        *held = Some(Held::new(air.coefficient));
        Ok(())
    }

    /// Takes the ball out of a hand, if there is one.
    pub fn take(&mut self, arm: usize) {
        if let Some(held) = self.held.get_mut(arm) {
            *held = None;
        }
    }

    /// Returns the arms whose hands hold a ball.
    pub fn holding(&self) -> [bool; ARMS] {
        self.held.map(|held| held.is_some())
    }

    /// Tells a hand when to let go of its ball; the first word counts.
    ///
    /// # Errors
    /// Where there is no such arm, and where the hand holds no ball.
    pub fn open(&mut self, command: &OpenCommand) -> Result<(), WorldError> {
        let OpenCommand { arm, open_ns } = *command;
        let held = self.held.get_mut(arm).ok_or(WorldError::Arm { arm })?;
        let held = held.as_mut().ok_or(WorldError::Hand {
            arm,
            expected: "a ball",
            found: "nothing",
        })?;
        held.open(
            self.time_ns,
            open_ns,
            &self.config.release,
            self.seed,
            self.releases,
        );
        self.releases += 1;
        Ok(())
    }

    /// Returns the ball that left a hand last.
    pub fn released(&self) -> Option<&Released> {
        self.released.as_ref()
    }

    /// Returns how a ball flies that has left a hand, as [`World::true_flight`] does.
    pub fn flight_of(&self, released: &Released) -> Vec<FlightSample> {
        let air = Aerodynamics::new(&self.config.ball, released.drag, released.spin);
        self.flight(released.at_ns, &released.state, &air)
    }

    /// Lets a ball fly that has left a hand `ago` seconds before, in this world's inertial frame; its number goes on from the last one's.
    ///
    /// # Panics
    /// As [`World::throw`].
    pub fn launch(&mut self, released: &Released, ago: f64) {
        self.take_away_missed(1);
        let air = Aerodynamics::new(&self.config.ball, released.drag, released.spin);
        let steps = (ago / BALL_STEP).ceil().max(1.0);
        let release =
            (0..steps as usize).fold(released.state, |state, _| air.fly(&state, ago / steps));
        self.thrown.push(Thrown {
            number: self.thrown.len() as u64,
            air,
            release_ns: self.time_ns,
            release,
            state: release,
            crossings: Crossings::default(),
            phase: Phase::Held,
        });
        self.verdicts.reserve(self.thrown.len());
    }

    /// Goes on by a tick: joints and hands are told `command` and `hands` at its begin. Returns what is sensed in it.
    ///
    /// A command that is not all numbers is ignored and counted, see [`World::ignored`]. `None` for a hand leaves it as it was told
    /// before.
    pub fn step(&mut self, command: &JointCommand, hands: &[Option<HandCommand>; ARMS]) -> &Sensed {
        let before = self.robot.frames.hands;
        let end_ns = self.time_ns + TICK_NS;
        for (hand, command) in self.hands.iter_mut().zip(hands) {
            hand.receive(self.time_ns, command.as_ref());
        }
        self.robot.advance(command);
        let during: [HandDuring; ARMS] = std::array::from_fn(|arm| HandDuring {
            frames: [before[arm], self.robot.frames.hands[arm]],
            closes_ns: self.hands[arm].closes_ns(),
        });
        for ball in &mut self.thrown {
            if let Some(verdict) = ball.advance([self.time_ns, end_ns], &during, &self.boxes) {
                if let Some(crossing) = verdict.crossing.filter(|_| verdict.caught()) {
                    self.held[crossing.arm] = Some(Held::new(ball.air.coefficient));
                }
                self.verdicts.push(verdict);
            }
        }
        for (arm, held) in self.held.iter_mut().enumerate() {
            let frames = &during[arm].frames;
            let left = held.and_then(|held| held.leaves(arm, [self.time_ns, end_ns], frames));
            if left.is_some() {
                (*held, self.released) = (None, left);
            }
        }
        self.time_ns = end_ns;
        if !self.boxes.is_empty()
            && let Some(contact) = deepest(end_ns, &self.capsules, &self.robot.places, &self.boxes)
        {
            self.contacts.take(contact);
        }
        self.sense();
        &self.sensed
    }

    fn sense(&mut self) {
        let number = self.time_ns / TICK_NS - 1;
        self.sensed.joints = JointState {
            number,
            sensor_ns: self.time_ns,
            q: self.robot.drives.q,
            dq: self.robot.drives.dq,
            tau: self.robot.torques,
        };
        self.sensed.imu = self.imu.sample(self.time_ns, &self.robot.felt);
        let balls = self
            .thrown
            .iter()
            .filter(|ball| ball.in_sight())
            .map(|ball| (ball.number, ball.state.position));
        self.sensed.circles = self.cameras.due(self.time_ns).then(|| {
            self.cameras.take(
                self.time_ns,
                &self.robot.frames.head,
                self.config.ball.radius,
                balls,
            )
        });
    }

    /// Puts boxes elsewhere, as far as their settings say so, away from the robot.
    pub fn rearrange(&mut self) {
        self.rearrangements += 1;
        let (capsules, places) = (&self.capsules, &self.robot.places);
        self.boxes = self
            .config
            .obstacles
            .place(self.seed, self.rearrangements, |standing| {
                is_clear_of(standing, capsules, places, PUT_APART)
            });
    }

    /// Returns the boxes where they stand.
    pub fn boxes(&self) -> &[StandingBox] {
        &self.boxes
    }

    /// Returns what the robot has touched so far; a part that is in a box touches it in every tick.
    pub fn contacts(&self) -> &Contacts {
        &self.contacts
    }

    /// Takes a depth picture now; each `number` has noise of its own.
    pub fn depth_picture(&self, number: u64) -> DepthPicture {
        let own: Vec<PlacedCapsule> = self
            .capsules
            .iter()
            .filter(|capsule| !capsule.is_head())
            .map(|capsule| capsule.placed(&self.robot.places))
            .collect();
        let head = &self.robot.frames.head;
        self.config
            .depth
            .take(self.seed, number, head, &self.boxes, &own)
    }

    /// Returns where detectors find the markers in the last pictures, pixels: of the left and the right wrist, in the left and the right
    /// picture. To be asked in the tick of the pictures, when [`Sensed::circles`] says that there are some.
    pub fn marker_features(&self) -> [[Option<[f64; 2]>; CAMERAS]; ARMS] {
        self.config.markers.find(
            &self.cameras,
            &self.robot.frames.head,
            &self.robot.wrists(),
            &self.markers,
            self.seed,
        )
    }

    /// Returns where the cameras are, inertial frame: middle of the lens, m, and from its directions (x along the optical axis).
    pub fn true_cameras(&self) -> [(Vector3<f64>, Matrix3<f64>); CAMERAS] {
        let head = &self.robot.frames.head;
        std::array::from_fn(|camera| {
            let (eye, turn) = self.cameras.mount(camera);
            (head.position + head.rotation * eye, head.rotation * turn)
        })
    }

    /// Returns the time, ns.
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Returns what is.
    pub fn truth(&self) -> Truth {
        let mut balls = [None; MAX_BALLS];
        let seen = self.thrown.iter().filter(|ball| ball.in_sight());
        for (place, ball) in balls.iter_mut().zip(seen) {
            *place = Some(BallTruth {
                number: ball.number,
                state: ball.state,
            });
        }
        Truth {
            time_ns: self.time_ns,
            balls,
            head: self.robot.frames.head,
            chest: self.robot.frames.chest,
            hands: self.robot.frames.hands,
            deflection: self.robot.deflection(),
            slip: self.robot.slip(),
        }
    }

    /// Returns what became of the balls, in the order in which it was settled: when caught, at the first bounce, or when away.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// Returns the whole flight of a thrown ball as if nobody caught it, from its release, every millisecond until it would touch the
    /// floor or a box. `None`: there is no ball of that number yet.
    pub fn true_flight(&self, ball: u64) -> Option<Vec<FlightSample>> {
        let ball = self.thrown.get(usize::try_from(ball).ok()?)?;
        Some(self.flight(ball.release_ns, &ball.release, &ball.air))
    }

    fn flight(&self, t_ns: u64, release: &BallState, air: &Aerodynamics) -> Vec<FlightSample> {
        let mut sample = FlightSample {
            t_ns,
            state: *release,
        };
        let mut flight = Vec::with_capacity(2000);
        while sample.state.position.z > self.config.ball.radius
            && !touches(&self.boxes, &sample.state, self.config.ball.radius)
        {
            flight.push(sample);
            for _ in 0..BALL_STEPS {
                sample.state = air.fly(&sample.state, BALL_STEP);
            }
            sample.t_ns += TICK_NS;
        }
        flight
    }

    /// Returns how many commands were ignored so far.
    pub fn ignored(&self) -> Ignored {
        Ignored {
            joints: self.robot.drives.ignored,
            hands: self.hands.each_ref().map(|hand| hand.ignored),
        }
    }
}

impl Thrown {
    fn in_sight(&self) -> bool {
        matches!(self.phase, Phase::Flying | Phase::Missed)
    }

    /// Moves the ball through a tick; returns a verdict when there is one.
    fn advance(
        &mut self,
        [start_ns, end_ns]: [u64; 2],
        hands: &[HandDuring; ARMS],
        boxes: &[StandingBox],
    ) -> Option<Verdict> {
        if self.phase == Phase::Held && self.release_ns <= start_ns {
            self.phase = Phase::Flying;
        }
        if !self.in_sight() {
            return None;
        }
        let mut flight = [self.state; BALL_STEPS + 1];
        let mut bounced = false;
        for i in 0..BALL_STEPS {
            let (state, touched) = self.air.step(&flight[i]);
            flight[i + 1] = state;
            bounced |= touched;
        }
        self.state = flight[BALL_STEPS];
        // A ball that meets a box is not followed any more.
        let stopped = touches(boxes, &self.state, self.air.radius);
        bounced |= stopped;
        let away =
            stopped || self.state.position.x < BEHIND || end_ns >= self.release_ns + LONGEST_NS;
        let mut verdict = None;
        if self.phase == Phase::Flying {
            let caught = !bounced && self.crossings.observe([start_ns, end_ns], &flight, hands);
            if caught || away || bounced {
                verdict = Some(self.crossings.verdict(self.number));
                self.phase = if caught { Phase::Gone } else { Phase::Missed };
            }
        }
        if away {
            self.phase = Phase::Gone;
        }
        verdict
    }
}

fn touches(boxes: &[StandingBox], ball: &BallState, radius: f64) -> bool {
    boxes
        .iter()
        .any(|standing| standing.distance(&ball.position) < radius)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::ready;
    use crate::{MAX_ACROSS, Miss};
    use nalgebra::Vector3;

    const NOBODY: [Option<HandCommand>; ARMS] = [None; ARMS];

    fn world(config: &WorldConfig, seed: u64) -> World {
        World::new(&RobotDescription::nominal(), config, seed, &ready()).unwrap()
    }

    fn stay() -> JointCommand {
        command(ready())
    }

    fn command(q: [f64; JOINTS]) -> JointCommand {
        JointCommand {
            number: 0,
            command_ns: 0,
            q,
            dq: [0.0; JOINTS],
        }
    }

    /// Everything moves a little.
    fn waving(tick: u64) -> JointCommand {
        let t = tick as f64 * 1e-3;
        command(std::array::from_fn(|i| {
            ready()[i] + 0.1 * (3.0 * t + i as f64).sin() - 0.1 * (i as f64).sin()
        }))
    }

    fn senses(config: &WorldConfig, seed: u64, ticks: u64) -> (Vec<Sensed>, Vec<Truth>) {
        let mut world = world(config, seed);
        world.throw(2);
        (0..ticks)
            .map(|tick| {
                let sensed = *world.step(&waving(tick), &NOBODY);
                (sensed, world.truth())
            })
            .unzip()
    }

    #[test]
    fn a_world_repeats_to_the_bit_from_its_seed() {
        let config = WorldConfig::default();
        let (first, truth) = senses(&config, 4, 1200);
        assert!((first.clone(), truth) == senses(&config, 4, 1200));
        assert!(first != senses(&config, 5, 1200).0);
    }

    #[test]
    fn sensors_keep_their_rates() {
        let (senses, _) = senses(&WorldConfig::default(), 1, 2000);
        assert_eq!(senses.iter().filter(|s| s.imu.is_some()).count(), 1024);
        let pictures: Vec<_> = senses.iter().filter_map(|s| s.circles).collect();
        assert_eq!(pictures.len(), 50);
        for (frame, [left, right]) in pictures.iter().enumerate() {
            assert_eq!((left.frame, right.frame), (frame as u64, frame as u64));
            assert_eq!(left.exposure_ns, right.exposure_ns);
            assert_eq!((left.camera, right.camera), (0, 1));
            assert_eq!(
                left.exposure_ns - pictures[0][0].exposure_ns,
                frame as u64 * 40 * TICK_NS
            );
        }
        for (number, sensed) in senses.iter().enumerate() {
            assert_eq!(sensed.joints.number, number as u64);
            assert_eq!(sensed.joints.sensor_ns, (number as u64 + 1) * TICK_NS);
        }
    }

    #[test]
    fn one_parts_randomness_does_not_shift_anothers() {
        let config = WorldConfig::default();
        let mut other = config.clone();
        other.cameras.clutter = 7.0;
        other.imu.scale = 0.1;
        let (plain, truth) = senses(&config, 4, 600);
        let (noisy, same) = senses(&other, 4, 600);
        assert!(truth == same);
        assert!(plain.iter().zip(&noisy).all(|(a, b)| a.joints == b.joints));
        for (a, b) in plain.iter().zip(&noisy) {
            let (Some(a), Some(b)) = (a.circles, b.circles) else {
                continue;
            };
            assert!(a[0].exposure_ns == b[0].exposure_ns);
        }
        other.errors.platform_slip = 0.0;
        assert!(truth != senses(&other, 4, 600).1);
    }

    #[test]
    fn a_ball_flies_as_its_true_flight_says() {
        let mut world = world(&WorldConfig::default(), 8);
        for _ in 0..100 {
            world.step(&stay(), &NOBODY);
        }
        world.throw(1);
        let flight = world.true_flight(0).unwrap();
        assert_eq!(flight[0].t_ns, 100 * TICK_NS);
        assert!(flight.len() > 500);
        for sample in &flight[1..] {
            world.step(&stay(), &NOBODY);
            let ball = world.truth().balls[0].unwrap();
            assert_eq!((world.time_ns(), ball.number), (sample.t_ns, 0));
            assert_eq!(ball.state, sample.state);
        }
        assert!(world.true_flight(1).is_none());
    }

    /// A straight, flat throw at the left hand, `off` (m) away from its middle; the hand closes `late_ns` after the ball's crossing.
    fn thrown_at_the_hand(seed: u64, off: Vector3<f64>, late_ns: i64) -> Verdict {
        let mut config = WorldConfig::default();
        let hand = world(&config, seed).truth().hands[0];
        let target = hand.position + off;
        config.thrower = crate::ThrowerConfig {
            distance: [4.0, 4.0],
            aside: [target.y, target.y],
            height: [1.5, 1.5],
            speed: [8.0, 8.0],
            box_least: target.into(),
            box_greatest: target.into(),
            gap: [0.0, 0.0],
        };
        let mut world = world(&config, seed);
        world.throw(1);
        let axis = hand.rotation.column(2).into_owned();
        let flight = world.true_flight(0).unwrap();
        let before = |sample: &FlightSample| axis.dot(&(sample.state.position - hand.position));
        let i = flight
            .iter()
            .position(|sample| before(sample) <= 0.0)
            .unwrap();
        let part = before(&flight[i]) / (before(&flight[i - 1]) - before(&flight[i]));
        let crossing_ns = flight[i].t_ns as i64 + (part * TICK_NS as f64) as i64;
        let catch = HandCommand {
            arm: 0,
            catch_ns: u64::try_from(crossing_ns + late_ns).unwrap(),
        };
        while world.verdicts().is_empty() {
            let told = world.time_ns() < 300 * TICK_NS;
            world.step(&stay(), &[told.then_some(catch), None]);
        }
        let [verdict] = world.verdicts() else {
            panic!("one ball, one verdict")
        };
        assert_eq!(world.truth().balls[0].is_none(), verdict.caught());
        *verdict
    }

    #[test]
    fn a_hand_at_the_crossing_catches_and_one_beside_or_late_does_not() {
        let centre = Vector3::zeros();
        let aside = |size: f64| Vector3::new(0.0, size, 0.0);
        let ms = TICK_NS as i64;
        for seed in 0..5 {
            let verdict = thrown_at_the_hand(seed, centre, 0);
            assert!(verdict.caught(), "{verdict:?}");
            let crossing = verdict.crossing.unwrap();
            // Aimed with longer steps, crossed on straight lines of 0.1 ms: micrometres and microseconds.
            assert!(crossing.across_m < 1e-5, "{crossing:?}");
            assert!(crossing.along_s.unwrap().abs() < 1e-5, "{crossing:?}");
            for (off, late, miss) in [
                (aside(0.04), 0, Some(Miss::Across)),
                (aside(-0.04), 0, Some(Miss::Across)),
                (aside(0.9 * MAX_ACROSS), 4 * ms, None),
                (centre, 30 * ms, Some(Miss::Late)),
                (centre, -30 * ms, Some(Miss::Early)),
            ] {
                let verdict = thrown_at_the_hand(seed, off, late);
                assert_eq!(verdict.miss, miss, "{verdict:?}");
            }
        }
    }

    #[test]
    fn every_ball_gets_one_verdict() {
        let mut world = world(&WorldConfig::default(), 3);
        let mut causes = Vec::new();
        for _ in 0..8 {
            world.throw(2);
            // Some still bounce when the next are thrown.
            for _ in 0..1600 {
                world.step(&stay(), &NOBODY);
            }
            causes.extend(world.verdicts().iter().map(|verdict| verdict.miss));
        }
        let balls: Vec<u64> = world
            .verdicts()
            .iter()
            .map(|verdict| verdict.ball)
            .collect();
        let mut sorted = balls.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..16).collect::<Vec<u64>>());
        assert!(
            causes
                .iter()
                .all(|miss| matches!(miss, Some(Miss::NeverCameNear | Miss::NoCommand)))
        );
    }

    #[test]
    fn commands_that_are_no_numbers_never_break_the_state() {
        let mut world = world(&WorldConfig::default(), 3);
        let before = world.truth();
        world.throw(1);
        for tick in 0..500 {
            let mut bad = stay();
            bad.q[tick % JOINTS] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY][tick % 3];
            let past = HandCommand {
                arm: 5,
                catch_ns: u64::MAX,
            };
            let sensed = *world.step(&bad, &[Some(past), None]);
            assert!(sensed.joints.q == ready());
            assert!(sensed.joints.tau.iter().all(|tau| tau.is_finite()));
        }
        let moved = (world.truth().head.position - before.head.position).norm();
        assert!(moved < 1e-10, "{moved}");
        assert_eq!(
            world.ignored(),
            Ignored {
                joints: 500,
                hands: [500, 0]
            }
        );
    }

    /// Steps between targets as far apart as ranges go: worse than any controller.
    #[test]
    fn the_wildest_commands_leave_all_finite() {
        let mut world = world(&WorldConfig::default(), 3);
        for tick in 0..3000 {
            let far = if tick / 150 % 2 == 0 { 1e3 } else { -1e3 };
            let mut wild = command([far; JOINTS]);
            wild.dq = [far * 1e9; JOINTS];
            world.step(&wild, &NOBODY);
        }
        let truth = world.truth();
        assert!(truth.head.position.iter().all(|x| x.is_finite()));
        // No torque limits yet; a torso that keeps its shape all the same.
        assert!(
            truth.deflection.iter().all(|e| e.abs() < 0.5),
            "{:?}",
            truth.deflection
        );
    }

    #[test]
    fn planted_errors_have_their_size() {
        let rigid = WorldConfig {
            torso: crate::TorsoConfig {
                stiffness: crate::Stiffness::Rigid,
                ..crate::TorsoConfig::default()
            },
            ..WorldConfig::default()
        };
        let mut off = rigid.clone();
        off.errors.arm_mount = 0.06;
        for seed in 0..5 {
            let (right, wrong) = (world(&rigid, seed).truth(), world(&off, seed).truth());
            for arm in 0..ARMS {
                let moved = wrong.hands[arm].position - right.hands[arm].position;
                assert!((moved.norm() - 0.06).abs() < 1e-12);
            }
            assert_eq!(right.head, wrong.head);
            let mut world = world(&rigid, seed);
            for tick in 0..1500 {
                let mut sideways = stay();
                sideways.q[0] = 0.4 * f64::from(tick) / 1500.0;
                world.step(&sideways, &NOBODY);
            }
            let truth = world.truth();
            assert!(truth.slip != 0.0 && truth.slip.abs() <= 0.006);
            let way = truth.chest.position.y - right.chest.position.y;
            assert!((way - world.robot.drives.q[0] - truth.slip).abs() < 1e-12);
        }
    }

    #[test]
    fn a_joint_that_starts_out_of_range_is_named() {
        let mut start = ready();
        start[8] = 3.5;
        let found = World::new(
            &RobotDescription::nominal(),
            &WorldConfig::default(),
            1,
            &start,
        );
        let error = found.err().unwrap().to_string();
        assert!(error.contains("joint 8 starts at 3.5"), "{error}");
    }

    #[test]
    fn the_world_depends_on_nothing_of_the_stack() {
        let tree = std::process::Command::new(env!("CARGO"))
            .args([
                "tree",
                "--offline",
                "--prefix",
                "none",
                "--edges",
                "normal,build,dev",
            ])
            .args(["--package", env!("CARGO_PKG_NAME")])
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .output()
            .unwrap();
        let tree = String::from_utf8(tree.stdout).unwrap();
        assert!(tree.contains("tactnet-catching-packets v"));
        assert!(!tree.contains("tactnet-catching v"), "{tree}");
    }

    #[test]
    fn a_ball_leaves_the_hand_that_it_was_given_to_and_flies_on_in_another_world() {
        let mut config = WorldConfig::default();
        config.release.jitter = 0.0;
        let mut first = world(&config, 5);
        assert_eq!(first.give(1), Ok(()));
        assert_eq!(first.holding(), [false, true]);
        let full = first.give(1).unwrap_err().to_string();
        assert!(full.contains("hand 1 holds a ball"), "{full}");
        let mut empty = OpenCommand {
            arm: 0,
            open_ns: 50 * TICK_NS,
        };
        let error = first.open(&empty).unwrap_err().to_string();
        assert!(
            error.contains("hand 0 holds nothing, expected a ball"),
            "{error}"
        );
        empty.arm = 2;
        assert_eq!(first.open(&empty), Err(WorldError::Arm { arm: 2 }));
        let open_ns = 50 * TICK_NS + 400_000;
        first.open(&OpenCommand { arm: 1, open_ns }).unwrap();
        for _ in 0..50 {
            first.step(&stay(), &NOBODY);
            assert_eq!(first.released(), None);
        }
        first.step(&stay(), &NOBODY);
        let released = *first.released().unwrap();
        assert_eq!((released.at_ns, first.holding()), (open_ns, [false; ARMS]));
        let hand = first.truth().hands[1].position;
        assert!((released.state.position - hand).norm() < 1e-9, "it stands");
        // Let fall elsewhere, 0.6 ms later.
        let mut second = world(&config, 6);
        second.launch(&released, 0.0006);
        let flight = first.flight_of(&released);
        for _ in 0..100 {
            second.step(&stay(), &NOBODY);
        }
        let ball = second.truth().balls[0].unwrap();
        let fallen = flight[100].state.position.z - ball.state.position.z;
        // 100.6 ms against 100 ms, at 0.97 m/s.
        assert!((fallen - 0.0006 * 0.973).abs() < 1e-5, "{fallen}");
    }
}
