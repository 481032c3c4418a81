//! Throws as cameras see them from a head that stands still and whose pose is known exactly: what the tracker alone is measured on.

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
use crate::look_ahead::{LookAhead, SAME_BALL, Said, true_at};
use crate::perception::{isometry, known_pose};
use crate::series::AHEAD;
use crate::throw::{nanoseconds, ticks, world_seed};

/// Pictures are taken this long before the throw, s: clutter comes first.
const WAIT: f64 = 0.2;

/// What detectors make of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Detectors {
    /// Every ball is found, and nothing else.
    Perfect,
    /// As the world has it: a ball is missed now and then, and there is clutter.
    Usual,
}

impl Detectors {
    /// Returns them as settings of the world.
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

/// The circles of both pictures, with the head's pose when they were taken.
#[derive(Debug, Clone)]
pub(crate) struct Pair {
    pub circles: [Circles; 2],
    pub head: HeadPose,
}

impl Pair {
    /// When they were taken, ns.
    pub fn t_ns(&self) -> u64 {
        self.head.t_ns
    }
}

/// One ball, thrown and seen.
#[derive(Debug, Clone)]
pub(crate) struct StillThrow {
    /// All pairs of pictures up to the catch.
    pub pairs: Vec<Pair>,
    flight: Vec<FlightSample>,
    /// When the ball passes through the middle of the thrower's box, which stands for the catch, ns.
    pub catch_ns: u64,
    /// The ball then.
    pub catch: Flight,
}

/// What the tracker made of it.
#[derive(Debug, Clone)]
pub(crate) struct Tracked {
    /// What was said of the ball, in the order of the pictures.
    pub said: Vec<Said>,
    /// How long each pair of [`StillThrow::pairs`] took, microseconds.
    pub micros: Vec<f64>,
}

impl StillThrow {
    /// Throws ball `number` of a series. Robot and torso are rigid and nothing moves but the ball; the same number is the same flight,
    /// whatever the detectors.
    ///
    /// # Errors
    /// Where the robot's description makes no sense.
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

    /// Gives all pairs to a new tracker, and keeps what it says of the ball.
    ///
    /// # Errors
    /// Where the tracker refuses a pair.
    pub fn track(&self, robot: &Robot, config: TrackConfig) -> Result<Tracked, TrialError> {
        let mut tracker = BallTracker::new(robot.description(), config)?;
        let (mut said, mut micros) = (Vec::new(), Vec::with_capacity(self.pairs.len()));
        for pair in &self.pairs {
            let begun = Instant::now();
            let found = tracker.push([&pair.circles[0], &pair.circles[1]], &pair.head)?;
            micros.push(begun.elapsed().as_secs_f64() * 1e6);
            let of_ball = found.valid().iter().map(|prediction| Said {
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

    /// Returns when the last pair at least [`AHEAD`] before the catch was taken, ns; `None` if the ball was in no picture by then.
    pub fn judged_ns(&self) -> Option<u64> {
        let latest = self.catch_ns.checked_sub(nanoseconds(AHEAD))?;
        self.pairs
            .iter()
            .filter(|pair| self.shows_ball(pair))
            .map(Pair::t_ns)
            .rfind(|t_ns| *t_ns <= latest)
    }

    /// Returns what follows from that pair, if it says anything of the ball.
    pub fn ahead<'a>(&self, tracked: &'a Tracked) -> Option<(&'a Said, LookAhead)> {
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

/// Lets a millisecond pass in which the robot stays as it is; returns the pair of pictures taken in it.
fn tick(world: &mut World, q: &[f64; JOINTS]) -> Option<Pair> {
    let command = JointCommand {
        number: 0,
        command_ns: world.time_ns(),
        q: *q,
        dq: [0.0; JOINTS],
    };
    let circles = world.step(&command, &[None, None]).circles?;
    let truth = world.truth();
    Some(Pair {
        circles,
        head: known_pose(&isometry(&truth.head), truth.time_ns),
    })
}

/// Returns when and where a ball passes through the plane across the middle of the thrower's box.
fn catch(flight: &[FlightSample], thrower: &ThrowerConfig) -> Option<(u64, Flight)> {
    let plane = (thrower.box_least[0] + thrower.box_greatest[0]) / 2.0;
    let before = flight
        .iter()
        .rfind(|sample| sample.state.position.x > plane)?;
    let left = (plane - before.state.position.x) / before.state.velocity.x;
    let at_ns = before.t_ns + nanoseconds(left);
    Some((at_ns, true_at(flight, at_ns)?))
}
