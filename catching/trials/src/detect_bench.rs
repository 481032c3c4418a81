//! Benchmark of the ball detector: accuracy and computation time.

use std::time::Instant;

use bytemuck::Zeroable;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::circles::{CircleConfig, CircleDetector};
use tactnet_catching::track::{BallTracker, TrackConfig};
use tactnet_catching_packets::joint;
use tactnet_catching_packets::packets::{BallPredictions, Circle, Circles, HeadPose, JointCommand};
use tactnet_catching_world::{Pictures, Truth, World, WorldConfig};

use crate::error::TrialError;
use crate::perception::{isometry, known_pose};
use crate::stepped_time::{nanoseconds, ticks, world_seed};
use tactnet_plot::Quantiles;

/// Time before a ball is thrown, in s.
const WAIT: f64 = 0.3;
/// Time after which a ball has passed, in s.
const LONGEST: f64 = 1.5;
/// Maximum distance of a true detection from the ball in pixels, and as a share of the radius; also the maximum
/// relative error of the radius.
const NEAR: (f64, f64) = (4.0, 0.2);
/// Lower ends of the radius classes, in pixels.
const CLASSES: [f64; 4] = [0.0, 12.0, 24.0, 48.0];
/// Amplitude in rad and angular frequency in rad/s of the head's motion.
const LOOKING: (f64, f64) = (0.12, 3.0);

/// Settings of the benchmark.
#[derive(Debug, Clone)]
pub struct DetectBench {
    /// Number of throws of one ball each.
    pub throws: usize,
    /// Seed of throws, rooms, people and noise.
    pub seed: u64,
    /// Settings of the world.
    pub world: WorldConfig,
}

/// Results. Everything except the times is reproducible bit by bit.
#[derive(Debug, Clone, Serialize)]
pub struct DetectReport {
    /// Number of throws.
    pub throws: usize,
    /// Seed of throws, rooms, people and noise.
    pub seed: u64,
    /// Number of pictures of both cameras.
    pub pictures: usize,
    /// Width and height, in pixels.
    pub size: [usize; 2],
    /// Results for independent pictures.
    pub search: DetectFigures,
    /// Results with gates at the positions that the tracker predicts.
    pub gated: DetectFigures,
}

/// Statistics of the detector.
#[derive(Debug, Clone, Serialize)]
pub struct DetectFigures {
    /// Number of balls that are completely in a picture.
    pub balls: usize,
    /// Recall of these balls.
    pub recall: f64,
    /// Results by radius.
    pub by_radius: Vec<RadiusClass>,
    /// Mean number of false detections per picture.
    pub false_alarms: f64,
    /// Root mean square error of the centre along each axis, in pixels.
    pub centre_px_rms: Option<f64>,
    /// Median distance of the centre from the true one, in pixels.
    pub centre_px_median: Option<f64>,
    /// Root mean square error of the radius, in pixels.
    pub radius_px_rms: Option<f64>,
    /// Mean error of the radius, in pixels.
    pub radius_px_mean: Option<f64>,
    /// Computation time per picture on one core, in ms.
    pub picture_ms: Option<Quantiles>,
}

/// Results for a class of radii.
#[derive(Debug, Clone, Serialize)]
pub struct RadiusClass {
    /// Minimum radius, in pixels.
    pub least: f64,
    /// Number of balls.
    pub balls: usize,
    /// Recall.
    pub recall: Option<f64>,
    /// Root mean square error of the centre along each axis, in pixels.
    pub centre_px_rms: Option<f64>,
}

#[derive(Default)]
struct Kept {
    errors: Vec<[f64; 3]>,
    /// True radius of each ball, and the squared error of the centre if it was found.
    balls: Vec<(f64, Option<f64>)>,
    false_alarms: usize,
    pictures: usize,
    millis: Vec<f64>,
}

impl DetectBench {
    /// Runs the benchmark.
    ///
    /// - `progress`: receives the number of finished throws
    ///
    /// # Errors
    /// An invalid description of the robot or an invalid setting.
    pub fn run(
        &self,
        robot: &Robot,
        mut progress: impl FnMut(usize),
    ) -> Result<DetectReport, TrialError> {
        let description = robot.description();
        let mut detector = CircleDetector::new(&description.cameras, CircleConfig::default());
        let (mut search, mut gated) = (Kept::default(), Kept::default());
        let mut size = [0, 0];
        for throw in 0..self.throws {
            let seed = world_seed(self.seed, throw as u64);
            let mut pictures = Pictures::new(description, &self.world, seed)?;
            let mut tracker = BallTracker::new(description, TrackConfig::default())?;
            let mut predictions = BallPredictions::zeroed();
            size = pictures.size();
            let mut pixels = vec![0; size[0] * size[1]];
            for (frame, truth) in self.exposures(robot, seed)?.iter().enumerate() {
                let pose = known_pose(&isometry(&truth.head), truth.time_ns);
                let mut seen = [0, 1].map(|camera| Circles {
                    frame: frame as u64,
                    exposure_ns: truth.time_ns,
                    camera,
                    ..Circles::zeroed()
                });
                for (camera, seen) in seen.iter_mut().enumerate() {
                    pictures.draw(truth, frame as u64, camera, &mut pixels);
                    let ball = whole(&pictures, truth, camera);
                    let mut alone = *seen;
                    search.add(&mut detector, &pixels, None, &mut alone, ball);
                    let expected = Some((&predictions, &pose));
                    gated.add(&mut detector, &pixels, expected, seen, ball);
                }
                predictions = tracker.push([&seen[0], &seen[1]], &pose)?;
            }
            progress(throw + 1);
        }
        Ok(DetectReport {
            throws: self.throws,
            seed: self.seed,
            pictures: search.pictures,
            size,
            search: search.figures(),
            gated: gated.figures(),
        })
    }

    /// Returns the true states at the exposures, from shortly before a throw until the ball has passed. The head
    /// moves.
    fn exposures(&self, robot: &Robot, seed: u64) -> Result<Vec<Truth>, TrialError> {
        let ready = robot.waiting();
        let mut world = World::new(robot.description(), &self.world, seed, &ready)?;
        let mut exposures = Vec::new();
        let end = nanoseconds(WAIT + LONGEST);
        let thrown = ticks(WAIT);
        let mut tick = 0;
        while world.time_ns() < end {
            if tick == thrown {
                world.throw(1);
            }
            tick += 1;
            let mut q = ready;
            let t = world.time_ns() as f64 * 1e-9;
            for (i, neck) in joint::NECK.enumerate() {
                q[neck] += LOOKING.0 * ((LOOKING.1 + i as f64) * t).sin();
            }
            let command = JointCommand::still(q);
            let exposed = world.step(&command, &[None, None]).circles.is_some();
            let truth = world.truth();
            if exposed {
                exposures.push(truth);
            }
            let mut balls = truth.balls.iter().flatten();
            if tick > thrown + 100 && balls.all(|ball| ball.state.position.x < 0.3) {
                break;
            }
        }
        Ok(exposures)
    }
}

/// Returns the ball in a picture if it is completely inside.
fn whole(pictures: &Pictures, truth: &Truth, camera: usize) -> Option<Circle> {
    let [width, height] = pictures.size().map(|size| size as f64);
    let circle = pictures.outline(truth, camera, 0)?;
    // The lens displaces the ball by up to a few hundredths of the width.
    let margin = circle.r + 0.04 * width;
    let inside = |x: f64, size: f64| x > margin && x < size - margin;
    (inside(circle.u, width) && inside(circle.v, height)).then_some(circle)
}

impl Kept {
    fn add(
        &mut self,
        detector: &mut CircleDetector,
        pixels: &[u8],
        expected: Option<(&BallPredictions, &HeadPose)>,
        circles: &mut Circles,
        ball: Option<Circle>,
    ) {
        let begun = Instant::now();
        detector.find_expected(pixels, expected, circles);
        self.millis.push(begun.elapsed().as_secs_f64() * 1e3);
        self.pictures += 1;
        let found = circles.valid();
        self.false_alarms += found.len();
        let Some(ball) = ball else { return };
        let own = found.iter().find(|circle| is_ball(circle, &ball));
        self.balls.push((
            ball.r,
            own.map(|circle| (circle.u - ball.u).powi(2) + (circle.v - ball.v).powi(2)),
        ));
        if let Some(circle) = own {
            self.false_alarms -= 1;
            self.errors
                .push([circle.u - ball.u, circle.v - ball.v, circle.r - ball.r]);
        }
    }

    fn figures(self) -> DetectFigures {
        let rms = |values: &[f64]| {
            (!values.is_empty())
                .then(|| (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt())
        };
        let centre: Vec<f64> = self.errors.iter().flat_map(|e| [e[0], e[1]]).collect();
        let radius: Vec<f64> = self.errors.iter().map(|e| e[2]).collect();
        let mut away: Vec<f64> = self.errors.iter().map(|e| e[0].hypot(e[1])).collect();
        away.sort_by(f64::total_cmp);
        let classes = CLASSES.iter().enumerate().map(|(i, &least)| {
            let most = CLASSES.get(i + 1).copied().unwrap_or(f64::INFINITY);
            let own = self
                .balls
                .iter()
                .filter(|ball| (least..most).contains(&ball.0));
            let squares: Vec<Option<f64>> = own.map(|ball| ball.1).collect();
            let found: Vec<f64> = squares.iter().flatten().copied().collect();
            let share = |x: f64, of: usize| (of > 0).then(|| x / of as f64);
            RadiusClass {
                least,
                balls: squares.len(),
                recall: share(found.len() as f64, squares.len()),
                centre_px_rms: share(found.iter().sum::<f64>() / 2.0, found.len()).map(f64::sqrt),
            }
        });
        DetectFigures {
            balls: self.balls.len(),
            recall: self.errors.len() as f64 / self.balls.len().max(1) as f64,
            by_radius: classes.collect(),
            false_alarms: self.false_alarms as f64 / self.pictures.max(1) as f64,
            centre_px_rms: rms(&centre),
            centre_px_median: away.get(away.len() / 2).copied(),
            radius_px_rms: rms(&radius),
            radius_px_mean: (!radius.is_empty())
                .then(|| radius.iter().sum::<f64>() / radius.len() as f64),
            picture_ms: Quantiles::of(self.millis),
        }
    }
}

/// Returns true if a detection matches the ball.
fn is_ball(circle: &Circle, ball: &Circle) -> bool {
    let near = NEAR.0.max(NEAR.1 * ball.r);
    (circle.u - ball.u).hypot(circle.v - ball.v) < near && (circle.r - ball.r).abs() < near
}
