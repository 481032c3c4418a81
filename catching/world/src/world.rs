//! The world: all parts together, tick by tick.

mod cages;
mod held_balls;
mod surroundings;

use nalgebra::Vector3;
use tactnet_catching_packets::packets::{
    Circles, HandCommand, HandOpening, ImuSample, JointCommand, JointState, MAX_BALLS,
};
use tactnet_catching_packets::{ARMS, JOINTS, RobotDescription, joint};

use crate::ball::{Aerodynamics, BALL_STEP, BallState};
use crate::caging::Approach;
use crate::cameras::{CAMERAS, Cameras};
use crate::config::WorldConfig;
use crate::contact::{Contacts, deepest, is_clear_of};
use crate::drives::TICK;
use crate::error::{WorldError, from_to};
use crate::fingers::{Basket, Fingers};
use crate::hand::Hand;
use crate::imu::Imu;
use crate::judge::{Crossings, HandDuring, Verdict};
use crate::obstacles::StandingBox;
use crate::release::{Held, Released};
use crate::robot::{FrameMotion, Robot};
use crate::shape::{CAPSULES, Capsule, capsules};
use crate::stream::Stream;
use crate::tendon::TendonSlip;
pub use cages::Grasp;
use held_balls::Away;
use surroundings::PUT_APART;

/// Duration of a tick, in ns.
pub const TICK_NS: u64 = 1_000_000;
/// Number of integration steps of a ball per tick.
const BALL_STEPS: usize = 10;
/// Time after the throw at which a ball is removed, in ns. Balls behind [`BEHIND`] are removed earlier.
const LONGEST_NS: u64 = 3_000_000_000;
/// Position along x at which a ball is removed, in m.
const BEHIND: f64 = -1.5;

/// Sensor values of a tick. They belong to its end, except the inertial sample, which has its own timestamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// Joint states, in every tick.
    pub joints: JointState,
    /// Inertial sample, 512 per second.
    pub imu: Option<ImuSample>,
    /// Left and right circles at the time of exposure, 25 per second. The caller adds the delay of cameras and
    /// detectors.
    pub circles: Option<[Circles; CAMERAS]>,
}

/// True state of a ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallTruth {
    /// Number, counted over the lifetime of the world.
    pub number: u64,
    /// Position and velocity.
    pub state: BallState,
}

/// Sample of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightSample {
    /// Time, in ns.
    pub t_ns: u64,
    /// Position and velocity.
    pub state: BallState,
}

/// Returns the point in m at which a flight descends to a height, interpolated between samples, or `None` if it never
/// does.
pub fn down_to(flight: &[FlightSample], height: f64) -> Option<nalgebra::Vector2<f64>> {
    flight.windows(2).find_map(|pair| {
        let [a, b] = [pair[0].state.position, pair[1].state.position];
        (a.z >= height && b.z < height).then(|| {
            let part = (a.z - height) / (a.z - b.z);
            (a + (b - a) * part).xy()
        })
    })
}

/// True state, for judges, oracles and reports, never for the stack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Truth {
    /// Time, in ns.
    pub time_ns: u64,
    /// Balls that fly or bounce, the earliest first.
    pub balls: [Option<BallTruth>; MAX_BALLS],
    /// Head frame.
    pub head: FrameMotion,
    /// Chest frame.
    pub chest: FrameMotion,
    /// Catch frames of the left and the right hand.
    pub hands: [FrameMotion; ARMS],
    /// Frames of the arms' last links, moved to the markers.
    pub markers: [FrameMotion; ARMS],
    /// Deflections of the torso's links from their drives, in rad: yaw, lower pitch, upper pitch.
    pub deflection: [f64; 3],
    /// Displacement of the platform from its drive, in m.
    pub slip: f64,
}

/// Numbers of ignored commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ignored {
    /// Joint commands with values that are not finite.
    pub joints: u64,
    /// Hand commands for the past or for another arm.
    pub hands: [u64; ARMS],
}

#[derive(Debug, Clone)]
struct Thrown {
    number: u64,
    air: Aerodynamics,
    release_ns: u64,
    release: BallState,
    /// Current state; the release state before the release.
    state: BallState,
    crossings: Crossings,
    phase: Phase,
    approach: Approach,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// In the thrower's hand.
    Held,
    /// In the air, without a verdict.
    Flying,
    /// Missed, but still visible.
    Missed,
    /// Caught or out of sight.
    Gone,
}

/// A robot, balls and time.
#[derive(Debug, Clone)]
pub struct World {
    config: WorldConfig,
    seed: u64,
    time_ns: u64,
    robot: Robot,
    hands: [Hand; ARMS],
    basket: Basket,
    fingers: [Fingers; ARMS],
    imu: Imu,
    cameras: Cameras,
    capsules: [Capsule; CAPSULES],
    boxes: Vec<StandingBox>,
    rearrangements: u64,
    contacts: Contacts,
    /// Displacements of the markers from their nominal places in the frames of the arms' last links, in m.
    markers: [Vector3<f64>; ARMS],
    thrown: Vec<Thrown>,
    verdicts: Vec<Verdict>,
    /// Balls in hands.
    held: [Option<Held>; ARMS],
    releases: u64,
    released: Option<Released>,
    /// Latest opening command of a hand that is not due, and the time of its arrival in ns.
    told: Option<(HandOpening, u64)>,
    opened: Option<HandOpening>,
    away: Option<Away>,
    sensed: Sensed,
}

fn check_rate(name: &'static str, rate: f64) -> Result<(), WorldError> {
    let a_tick = [f64::MIN_POSITIVE, 1.0 / TICK];
    Ok(from_to(a_tick, "at most one in a tick, 1000 Hz")(
        name, &rate,
    )?)
}

impl World {
    /// Creates a robot at rest at `start` (rad or m, within the ranges), at time 0, without balls.
    ///
    /// # Errors
    /// A setting or a joint that is out of range, a target box that no throw reaches, or torso springs that are too
    /// weak for the robot.
    pub fn new(
        description: &RobotDescription,
        config: &WorldConfig,
        seed: u64,
        start: &[f64; JOINTS],
    ) -> Result<Self, WorldError> {
        config.check()?;
        check_rate("description.imu.rate", description.imu.rate)?;
        check_rate("description.cameras.rate", description.cameras.rate)?;
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
            basket: Basket::new(&config.fingers),
            fingers: [Fingers::default(); ARMS],
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
            told: None,
            opened: None,
            away: None,
            sensed,
        })
    }

    /// Throws the first of `balls` balls now, and each further one after a random gap. Numbers continue from the last
    /// throw. Missed balls that are still visible are removed.
    ///
    /// # Panics
    /// More than [`MAX_BALLS`] balls without a verdict.
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
            self.hold(air, release_ns, release);
        }
    }

    /// Puts a ball into the thrower's hand until its release.
    fn hold(&mut self, air: Aerodynamics, release_ns: u64, release: BallState) {
        self.thrown.push(Thrown {
            number: self.thrown.len() as u64,
            air,
            release_ns,
            release,
            state: release,
            crossings: Crossings::default(),
            phase: Phase::Held,
            approach: Approach::Far,
        });
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

    /// Advances by a tick. Joints and hands receive `command` and `hands` at its start. Returns the sensor values of
    /// the tick.
    ///
    /// A command with a value that is not finite is ignored and counted, see [`World::ignored`]. `None` keeps the
    /// previous command of a hand.
    pub fn step(&mut self, command: &JointCommand, hands: &[Option<HandCommand>; ARMS]) -> &Sensed {
        let before = self.robot.frames.hands;
        let end_ns = self.time_ns + TICK_NS;
        for (hand, command) in self.hands.iter_mut().zip(hands) {
            hand.receive(self.time_ns, command.as_ref());
        }
        self.open();
        self.robot.advance(command);
        let during: [HandDuring; ARMS] = std::array::from_fn(|arm| HandDuring {
            frames: [before[arm], self.robot.frames.hands[arm]],
            closes_ns: self.hands[arm].closes_ns,
        });
        self.touch(&during);
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
        let thrown = self.thrown.iter().filter(|ball| ball.in_sight());
        let balls = thrown
            .map(|ball| (ball.number, ball.state.position))
            .chain(self.away.map(|away| (away.number, away.state.position)));
        let (now_ns, head) = (self.time_ns, &self.robot.frames.head);
        let radius = self.config.ball.radius;
        let due = self.cameras.due(now_ns);
        self.sensed.circles = due.then(|| self.cameras.take(now_ns, head, radius, balls));
    }

    /// Applies a tendon slip now.
    ///
    /// # Errors
    /// Same as [`TendonSlip::check`].
    pub fn slip(&mut self, slip: &TendonSlip) -> Result<(), WorldError> {
        slip.check()?;
        let joint = joint::ARM[slip.arm].start + slip.joint;
        self.robot.slip_joint(joint, slip.angle);
        Ok(())
    }

    /// Returns the time, in ns.
    pub fn time_ns(&self) -> u64 {
        self.time_ns
    }

    /// Returns the true state.
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
            markers: self.true_markers(),
            deflection: self.robot.deflection(),
            slip: self.robot.slip(),
        }
    }

    /// Returns the verdicts in the order of their decision: at the catch, at the first bounce, or when the ball is
    /// out of sight.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// Returns the whole flight of a thrown ball as if it were not caught: every millisecond from the release until
    /// it touches the floor or a box. `None` if no ball has that number yet.
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

    /// Returns the numbers of ignored commands so far.
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

    /// Moves the ball through a tick. Returns a verdict if it is decided in this tick.
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
        // A ball that hits a box is removed.
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
