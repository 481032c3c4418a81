//! The world: everything put together, tick by tick.

mod held_balls;
mod surroundings;

use nalgebra::Vector3;
use tactnet_catching_packets::packets::{
    Circles, HandCommand, ImuSample, JointCommand, JointState, MAX_BALLS,
};
use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription, joint};

use crate::ball::{Aerodynamics, BALL_STEP, BallState};
use crate::cameras::{CAMERAS, Cameras};
use crate::config::WorldConfig;
use crate::contact::{Contacts, deepest, is_clear_of};
use crate::drives::TICK;
use crate::error::{WorldError, within};
use crate::hand::Hand;
use crate::imu::Imu;
use crate::judge::{Crossings, HandDuring, Verdict};
use crate::obstacles::StandingBox;
use crate::release::{Held, Released};
use crate::robot::{FrameMotion, Robot};
use crate::shape::{CAPSULES, Capsule, capsules};
use crate::stream::Stream;
use crate::tendon::TendonSlip;
use held_balls::Away;
use surroundings::PUT_APART;

/// A tick, ns.
pub const TICK_NS: u64 = 1_000_000;
/// Steps of a ball in a tick.
const BALL_STEPS: usize = 10;
/// A ball is gone this long after it was thrown, ns, or farther behind the robot than [`BEHIND`].
const LONGEST_NS: u64 = 3_000_000_000;
/// m.
const BEHIND: f64 = -1.5;

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

/// Returns the point, m, at which a flight falls to a height, interpolated between its samples; `None` if it never does.
pub fn down_to(flight: &[FlightSample], height: f64) -> Option<nalgebra::Vector2<f64>> {
    flight.windows(2).find_map(|pair| {
        let [a, b] = [pair[0].state.position, pair[1].state.position];
        (a.z >= height && b.z < height).then(|| {
            let part = (a.z - height) / (a.z - b.z);
            (a + (b - a) * part).xy()
        })
    })
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
    away: Option<Away>,
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
            away: None,
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
        self.fly_on();
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
            .map(|ball| (ball.number, ball.state.position))
            .chain(self.away.map(|away| (away.number, away.state.position)));
        self.sensed.circles = self.cameras.due(self.time_ns).then(|| {
            self.cameras.take(
                self.time_ns,
                &self.robot.frames.head,
                self.config.ball.radius,
                balls,
            )
        });
    }

    /// Lets a tendon slip now.
    ///
    /// # Errors
    /// As [`TendonSlip::check`].
    pub fn slip(&mut self, slip: &TendonSlip) -> Result<(), WorldError> {
        slip.check()?;
        let joint = joint::ARM[slip.arm].start + slip.joint;
        self.robot.slip_joint(joint, slip.angle);
        Ok(())
    }

    /// Returns the time, ns.
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Returns what is.
    pub fn truth(&self) -> Truth {
        let mut balls = [None; MAX_BALLS];
        let truth = |number: u64, state: BallState| BallTruth { number, state };
        let thrown = self.thrown.iter().filter(|ball| ball.in_sight());
        let seen = thrown
            .map(|ball| truth(ball.number, ball.state))
            .chain(self.away.map(|away| truth(away.number, away.state)));
        for (place, ball) in balls.iter_mut().zip(seen) {
            *place = Some(ball);
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
mod tests;
