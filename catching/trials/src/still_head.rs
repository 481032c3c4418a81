//! Throws seen from a head at rest with an exactly known pose, for measurements of the tracker alone.

use std::time::Instant;

use nalgebra::Isometry3;
use tactnet_catching::Robot;
use tactnet_catching::flight::Flight;
use tactnet_catching::track::{BallTracker, TrackConfig};
use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::{Circles, HeadPose, JointCommand};
use tactnet_catching_world::{
    CamerasConfig, FlightSample, Stiffness, ThrowerConfig, TorsoConfig, World, WorldConfig,
};

use crate::error::TrialError;
use crate::look_ahead::{AHEAD, LookAhead, SAME_BALL, TimedPrediction, true_at};
use crate::perception::{isometry, known_pose};
use crate::stepped_time::{nanoseconds, ticks, world_seed};

/// Time with pictures before the throw in s, in which there is only clutter.
const WAIT: f64 = 0.2;

/// Quality of the circle detector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Detectors {
    /// Every ball is found, without false detections.
    Perfect,
    /// The world's default: some balls are missed, and there is clutter.
    Usual,
}

impl Detectors {
    /// Returns the settings of the world.
    pub fn cameras(self) -> CamerasConfig {
        let usual = CamerasConfig::default();
        match self {
            Self::Perfect => CamerasConfig {
                detection: 1.0,
                clutter: 0.0,
                ..usual
            },
            Self::Usual => usual,
        }
    }
}

/// Circles of both pictures and the head pose at their exposure.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    pub circles: [Circles; 2],
    pub head: HeadPose,
}

impl Pair {
    /// Returns the time of the exposure, in ns.
    pub fn t_ns(&self) -> u64 {
        self.head.t_ns
    }
}

/// One thrown ball and its pictures.
#[derive(Debug, Clone)]
pub(crate) struct StillThrow {
    /// All pairs of pictures until the catch.
    pub pairs: Vec<Pair>,
    flight: Vec<FlightSample>,
    /// Time at which the ball passes the centre of the target box, which represents the catch, in ns.
    pub catch_ns: u64,
    /// True ball at that time.
    pub catch: Flight,
}

/// Results of the tracker for a throw.
#[derive(Debug, Clone)]
pub(crate) struct Tracked {
    /// Predictions of the ball, in the order of the pictures.
    pub said: Vec<TimedPrediction>,
    /// Computation time of each pair of [`StillThrow::pairs`], in µs.
    pub micros: Vec<f64>,
}

impl StillThrow {
    /// Throws ball `number` of a series. Robot and torso are rigid, and only the ball moves. The same number gives
    /// the same flight for all detectors.
    ///
    /// # Errors
    /// An invalid description of the robot.
    pub fn new(
        robot: &Robot,
        detectors: Detectors,
        seed: u64,
        number: u64,
    ) -> Result<Self, TrialError> {
        let config = WorldConfig {
            torso: TorsoConfig {
                stiffness: Stiffness::Rigid,
                ..TorsoConfig::default()
            },
            cameras: detectors.cameras(),
            ..WorldConfig::default()
        };
        let seed = world_seed(seed, number);
        let ready = robot.waiting();
        let mut world = World::new(robot.description(), &config, seed, &ready)?;
        let mut pairs = Vec::new();
        for _ in 0..ticks(WAIT) {
            pairs.extend(tick(&mut world, &ready));
        }
        world.throw(1);
        let flight = world.true_flight(0).unwrap_or_default();
        let (catch_ns, catch) =
            catch(&flight, &config.thrower).expect("throws pass through the thrower's box");
        while world.time_ns() + nanoseconds(1e-3) < catch_ns {
            pairs.extend(tick(&mut world, &ready));
        }
        Ok(Self {
            pairs,
            flight,
            catch_ns,
            catch,
        })
    }

    /// Returns true if a pair shows the ball in flight.
    pub fn shows_ball(&self, pair: &Pair) -> bool {
        self.flight
            .first()
            .is_some_and(|release| release.t_ns <= pair.t_ns())
    }

    /// Runs a new tracker on all pairs and returns its predictions of the ball.
    ///
    /// # Errors
    /// A pair that the tracker refuses.
    pub fn track(&self, robot: &Robot, config: TrackConfig) -> Result<Tracked, TrialError> {
        let mut tracker = BallTracker::new(robot.description(), config)?;
        let (mut said, mut micros) = (Vec::new(), Vec::with_capacity(self.pairs.len()));
        for pair in &self.pairs {
            let begun = Instant::now();
            let found = tracker.push([&pair.circles[0], &pair.circles[1]], &pair.head)?;
            micros.push(begun.elapsed().as_secs_f64() * 1e6);
            let of_ball = found.valid().iter().map(|prediction| TimedPrediction {
                exposure_ns: found.exposure_ns,
                prediction: *prediction,
                aligned: Isometry3::identity(),
            });
            said.extend(of_ball.filter(|said| {
                said.distance(&self.flight)
                    .is_some_and(|distance| distance < SAME_BALL)
            }));
        }
        Ok(Tracked { said, micros })
    }

    /// Returns the time of the last pair at least [`AHEAD`] before the catch in ns; `None` if no picture showed the
    /// ball by then.
    pub fn judged_ns(&self) -> Option<u64> {
        let latest = self.catch_ns.checked_sub(nanoseconds(AHEAD))?;
        self.pairs
            .iter()
            .filter(|pair| self.shows_ball(pair))
            .map(Pair::t_ns)
            .rfind(|t_ns| *t_ns <= latest)
    }

    /// Returns the prediction after that pair and its error, if there is one.
    pub fn ahead<'a>(&self, tracked: &'a Tracked) -> Option<(&'a TimedPrediction, LookAhead)> {
        let judged_ns = self.judged_ns()?;
        let said = tracked
            .said
            .iter()
            .rfind(|said| said.exposure_ns == judged_ns)?;
        let still = Isometry3::identity();
        let ahead = said.judge(&still, self.catch_ns, &self.catch.p, &self.catch.v);
        Some((said, ahead))
    }
}

/// Advances by 1 ms with a robot at rest. Returns the pair of pictures in it, if there is one.
fn tick(world: &mut World, q: &[f64; JOINTS]) -> Option<Pair> {
    let command = JointCommand::still(*q);
    let circles = world.step(&command, &[None, None]).circles?;
    let truth = world.truth();
    Some(Pair {
        circles,
        head: known_pose(&isometry(&truth.head), truth.time_ns),
    })
}

/// Returns time and state of a ball at the plane through the centre of the target box.
fn catch(flight: &[FlightSample], thrower: &ThrowerConfig) -> Option<(u64, Flight)> {
    let plane = (thrower.box_least[0] + thrower.box_greatest[0]) / 2.0;
    let before = flight
        .iter()
        .rfind(|sample| sample.state.position.x > plane)?;
    let left = (plane - before.state.position.x) / before.state.velocity.x;
    let at_ns = before.t_ns + nanoseconds(left);
    Some((at_ns, true_at(flight, at_ns)?))
}
