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

/// Returns a circle detector that finds every ball, without false detections.
pub(crate) fn perfect() -> CamerasConfig {
    CamerasConfig {
        detection: 1.0,
        clutter: 0.0,
        ..CamerasConfig::default()
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
    /// the same flight for all settings of the detector.
    ///
    /// # Errors
    /// An invalid description of the robot.
    pub fn new(
        robot: &Robot,
        cameras: CamerasConfig,
        seed: u64,
        number: u64,
    ) -> Result<Self, TrialError> {
        let config = WorldConfig {
            torso: TorsoConfig {
                stiffness: Stiffness::Rigid,
                ..TorsoConfig::default()
            },
            cameras,
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
        let shows = self.pairs.iter().filter(|pair| self.shows_ball(pair));
        shows.map(Pair::t_ns).rfind(|t_ns| *t_ns <= latest)
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use tactnet_catching::track::TrackError;
    use tactnet_catching_packets::packets::{BallPrediction, BallPredictions};
    use tactnet_catching_world::{BallState, Released};

    use super::*;

    fn tracker() -> BallTracker {
        let robot = Robot::nominal();
        BallTracker::new(robot.description(), TrackConfig::default()).unwrap()
    }

    fn push(tracker: &mut BallTracker, pair: &Pair) -> Result<BallPredictions, TrackError> {
        tracker.push(pair.circles.each_ref(), &pair.head)
    }

    /// Returns a world with a rigid robot and the given number of false circles per picture.
    fn world(seed: u64, clutter: f64) -> World {
        let mut config = WorldConfig::default();
        config.torso.stiffness = Stiffness::Rigid;
        config.cameras.clutter = clutter;
        let robot = Robot::nominal();
        World::new(robot.description(), &config, seed, &robot.waiting()).unwrap()
    }

    #[test]
    fn clutter_alone_is_no_ball() {
        let (mut world, mut tracker) = (world(3, 4.0), tracker());
        let ready = Robot::nominal().waiting();
        for pair in (0..20_000).filter_map(|_| tick(&mut world, &ready)) {
            assert_eq!(push(&mut tracker, &pair).unwrap().count, 0);
        }
    }

    /// Round objects in a row, found in every picture, form more pairs than a tracker considers. They are not tracked as
    /// balls, and a ball that is found after them is tracked.
    #[test]
    fn objects_at_rest_are_no_balls() {
        let robot = Robot::nominal();
        let [throw, other] = [5, 6].map(|seed| {
            let throw = StillThrow::new(&robot, perfect(), seed, 0);
            throw.unwrap()
        });
        let shows_one = |pair: &&Pair| pair.circles.iter().all(|circles| circles.count == 1);
        let object = other.pairs.iter().find(shows_one).unwrap().circles;
        let mut tracker = tracker();
        let mut seen = 0;
        for (number, pair) in throw.pairs.iter().enumerate() {
            let mut pair = pair.clone();
            for (camera, into) in pair.circles.iter_mut().enumerate() {
                // The objects are there before the ball.
                let shown = if number < 3 { 0 } else { into.count as usize };
                let balls = into.circles[..shown].to_vec();
                into.count = 0;
                let row = (0..20).map(|i| {
                    let mut circle = object[camera].circles[0];
                    let shake = 0.3 * ((7 * number + 3 * i + camera) as f64).sin();
                    circle.u += 2.0 * i as f64 + shake;
                    circle
                });
                for circle in row.chain(balls) {
                    into.circles[into.count as usize] = circle;
                    into.count += 1;
                }
            }
            let found = push(&mut tracker, &pair).unwrap();
            for ball in found.valid().iter().filter(|ball| ball.frames > 1) {
                let said = TimedPrediction {
                    exposure_ns: found.exposure_ns,
                    prediction: *ball,
                    aligned: Isometry3::identity(),
                };
                let off = said.distance(&throw.flight);
                let is_ball = off.is_some_and(|off| off < SAME_BALL);
                // The first pictures cannot tell objects from balls.
                assert!(is_ball || number < 3, "{number}: {ball:?}");
                seen += usize::from(is_ball);
            }
        }
        assert!(seen > 10, "{seen}");
    }

    #[test]
    fn balls_that_cross_keep_their_numbers() {
        let ready = Robot::nominal().waiting();
        for seed in 0..10 {
            let (mut world, mut tracker) = (world(seed, 1.0), tracker());
            for aside in [0.4, -0.4] {
                let state = BallState {
                    position: Vector3::new(5.5, aside, 1.5 + aside / 8.0),
                    velocity: Vector3::new(-6.4, -2.5 * aside, 3.8),
                };
                let released = Released {
                    arm: 0,
                    at_ns: 0,
                    state,
                    spin: Vector3::zeros(),
                    drag: 0.47,
                };
                world.launch(&released, 0.0);
            }
            let mut numbers = Vec::new();
            for _ in 0..740 {
                let Some(pair) = tick(&mut world, &ready) else {
                    continue;
                };
                let (found, truth) = (push(&mut tracker, &pair).unwrap(), world.truth());
                let ball = |ball: usize| {
                    let place = truth.balls[ball]?.state.position;
                    let said = found.valid().iter();
                    let off = |said: &BallPrediction| (Vector3::from(said.p) - place).norm();
                    Some(said.min_by(|a, b| off(a).total_cmp(&off(b)))?.ball)
                };
                numbers.push([ball(0), ball(1)]);
            }
            // The tracker knows both after 0.3 s, and they cross after 0.4 s.
            let (known, last) = (numbers[7], numbers[numbers.len() - 1]);
            let apart = known[0].is_some() && known[0] != known[1];
            assert!(apart, "seed {seed}: {known:?}");
            assert_eq!(known, last, "seed {seed}");
        }
    }

    #[test]
    fn the_order_of_circles_does_not_matter() {
        let throw = StillThrow::new(&Robot::nominal(), CamerasConfig::default(), 5, 0).unwrap();
        let (mut forward, mut backward) = (tracker(), tracker());
        for pair in &throw.pairs {
            let mut turned = pair.clone();
            for circles in &mut turned.circles {
                circles.circles[..circles.count as usize].reverse();
            }
            let [one, other] = [push(&mut forward, pair), push(&mut backward, &turned)];
            assert_eq!(one.unwrap(), other.unwrap());
        }
    }

    #[test]
    fn pictures_that_are_none_are_refused_and_the_next_ones_taken() {
        let throw = StillThrow::new(&Robot::nominal(), perfect(), 7, 0).unwrap();
        let mut tracker = tracker();
        let mut last = 0;
        for pair in &throw.pairs {
            let mut refused = |spoil: fn(&mut Pair)| {
                let mut spoilt = pair.clone();
                spoil(&mut spoilt);
                push(&mut tracker, &spoilt).unwrap_err()
            };
            let circle = refused(|pair| {
                (pair.circles[0].count, pair.circles[0].circles[0].u) = (1, f64::NAN);
            });
            assert!(matches!(circle, TrackError::Circle { .. }));
            let count = refused(|pair| pair.circles[0].count = 1 << 20);
            assert!(matches!(count, TrackError::Count { .. }));
            let exchanged = refused(|pair| pair.circles.reverse());
            assert!(matches!(exchanged, TrackError::Pair { .. }));
            let head = refused(|pair| pair.head.position[1] = f64::INFINITY);
            assert!(matches!(head, TrackError::Head { .. }));
            last = push(&mut tracker, pair).unwrap().count;
            let late = push(&mut tracker, pair).unwrap_err();
            assert!(matches!(late, TrackError::Late { .. }));
        }
        assert_eq!(last, 1);
    }
}
