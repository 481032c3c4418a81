//! Circles of throws for other trackers, with initial states and the results of this project.

use std::time::Instant;

use nalgebra::{SMatrix, SVector, Vector3};
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::flight::{BALL_RADIUS, GRAVITY};
use tactnet_catching::track::{BallState, Head, STATES, TrackConfig};
use tactnet_catching_packets::packets::{BallPrediction, Circles, HeadPose};

use crate::error::TrialError;
use crate::look_ahead::TimedPrediction;
use crate::still_head::{Detectors, StillThrow};

/// Throws with all parameters of their models, in SI units and pixels, inertial frame.
#[derive(Debug, Clone, Serialize)]
pub struct PeerCircles {
    /// Seed of throws, noise and clutter.
    pub seed: u64,
    /// Cameras.
    pub cameras: PeerCameras,
    /// Gravity minus buoyancy per effective mass, in m/s^2.
    pub gravity: f64,
    /// Radius of the ball, in m.
    pub ball_radius: f64,
    /// Settings of this project's tracker, equal for all throws.
    pub config: TrackConfig,
    /// Throws.
    pub throws: Vec<PeerThrow>,
}

/// Two cameras along the head's x axis; y points left, z up.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PeerCameras {
    /// Positions of the left and the right camera in the head frame, in m.
    pub offsets: [[f64; 3]; 2],
    /// Focal length, in pixels.
    pub focal: f64,
    /// Width and height of a picture, in pixels.
    pub size: [f64; 2],
    /// Exposure time, in s.
    pub exposure: f64,
}

/// One ball, seen from a head at rest.
#[derive(Debug, Clone, Serialize)]
pub struct PeerThrow {
    /// Number in the series.
    pub number: u64,
    /// Position of the head, in m.
    pub head: [f64; 3],
    /// Rotation from the head frame to the inertial frame, row by row.
    pub head_rotation: [[f64; 3]; 3],
    /// Time of the catch, in ns.
    pub catch_ns: u64,
    /// True position at the catch, in m.
    pub p: [f64; 3],
    /// True velocity at the catch, in m/s.
    pub v: [f64; 3],
    /// Pictures without clutter and misses; `None` if the tracker never reported the ball.
    pub alone: Option<PeerFilter>,
    /// Pictures with clutter and misses; `None` if the tracker did not report the ball before the evaluated
    /// prediction.
    pub cluttered: Option<PeerTrack>,
}

/// Position, velocity, drag and lift, with their covariance.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PeerState {
    /// Time, in ns.
    pub t_ns: u64,
    /// Position in m, velocity in m/s, drag in 1/m, lift in 1/s.
    pub x: [f64; STATES],
    /// Covariance, row by row.
    pub covariance: [[f64; STATES]; STATES],
}

/// A single filter with known association of circles and ball.
#[derive(Debug, Clone, Serialize)]
pub struct PeerFilter {
    /// Initial state: the tracker's first report.
    pub start: PeerState,
    /// Subsequent pictures.
    pub pairs: Vec<PeerStep>,
}

/// A pair of pictures that contains only a ball, and the filter state after it.
#[derive(Debug, Clone, Serialize)]
pub struct PeerStep {
    /// u, v and r in pixels, left and right; `None` if the ball is not in the picture.
    pub circles: [Option<[f64; 3]>; 2],
    /// Filter state of this project at the time of the pictures.
    pub ours: PeerState,
    /// Computation time of this project's filter, in µs.
    pub us: f64,
}

/// A tracker with a given initial state.
#[derive(Debug, Clone, Serialize)]
pub struct PeerTrack {
    /// Initial state: the tracker's first report.
    pub start: PeerState,
    /// Subsequent pictures, up to the last pair at least 200 ms before the catch.
    pub pairs: Vec<PeerPair>,
    /// Result of this project's tracker after the last pair; `None` if it lost the ball.
    pub ours: Option<PeerPrediction>,
}

/// All circles of a pair of pictures.
#[derive(Debug, Clone, Serialize)]
pub struct PeerPair {
    /// Time of the exposure, in ns.
    pub t_ns: u64,
    /// u, v and r in pixels, left and right.
    pub circles: [Vec<[f64; 3]>; 2],
    /// Computation time of this project's tracker, in µs.
    pub us: f64,
}

/// Prediction of this project's tracker after the last pair, and its error at the catch.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct PeerPrediction {
    /// State of the tracker.
    pub state: PeerState,
    /// Error perpendicular to the flight, in mm.
    pub across_mm: f64,
    /// Error along the flight in ms; negative if early.
    pub along_ms: f64,
    /// Normalised squared error of the position.
    pub nees: f64,
}

/// Returns the first `count` throws of a seed, the same as those of a [`TrackBench`](crate::TrackBench). `progress`
/// receives the number of finished throws.
///
/// # Errors
/// An invalid description of the robot or an invalid setting of the tracker.
pub fn peer_circles(
    robot: &Robot,
    config: TrackConfig,
    seed: u64,
    count: usize,
    mut progress: impl FnMut(usize),
) -> Result<PeerCircles, TrialError> {
    let cameras = &robot.description().cameras;
    let mut throws = Vec::with_capacity(count);
    for number in 0..count as u64 {
        throws.push(peer_throw(robot, config, seed, number)?);
        progress(throws.len());
    }
    let [left, right] = tactnet_catching::track::Camera::pair(cameras);
    Ok(PeerCircles {
        seed,
        cameras: PeerCameras {
            offsets: [left.offset.into(), right.offset.into()],
            focal: left.focal,
            size: left.size,
            exposure: cameras.exposure,
        },
        gravity: GRAVITY,
        ball_radius: BALL_RADIUS,
        config,
        throws,
    })
}

fn peer_throw(
    robot: &Robot,
    config: TrackConfig,
    seed: u64,
    number: u64,
) -> Result<PeerThrow, TrialError> {
    let alone = StillThrow::new(robot, Detectors::Perfect, seed, number)?;
    let cluttered = StillThrow::new(robot, Detectors::Usual, seed, number)?;
    let head = head(&alone.pairs[0].head);
    Ok(PeerThrow {
        number,
        head: head.position.into(),
        head_rotation: std::array::from_fn(|i| std::array::from_fn(|j| head.rotation[(i, j)])),
        catch_ns: alone.catch_ns,
        p: alone.catch.p.into(),
        v: alone.catch.v.into(),
        alone: filtered(&alone, robot, config)?,
        cluttered: tracked(&cluttered, robot, config)?,
    })
}

/// Runs the filter alone on a ball, circle by circle.
fn filtered(
    throw: &StillThrow,
    robot: &Robot,
    config: TrackConfig,
) -> Result<Option<PeerFilter>, TrialError> {
    let said = throw.track(robot, config)?.said;
    let Some(start) = said.first().map(reported) else {
        return Ok(None);
    };
    let root = covariance(&start).cholesky();
    let root = root.expect("a reported covariance is positive").unpack();
    let mut state = BallState::new(SVector::from(start.x), root);
    let mut pairs = Vec::new();
    let all = throw.pairs.windows(2);
    for pair in all.filter(|pair| pair[0].t_ns() >= start.t_ns) {
        let heads = [head(&pair[0].head), head(&pair[1].head)];
        let circles = pair[1].circles.each_ref().map(only);
        let begun = Instant::now();
        let followed = state.follow(
            robot.description(),
            &config,
            heads.each_ref(),
            circles.each_ref().map(Option::as_ref),
        );
        let us = begun.elapsed().as_secs_f64() * 1e6;
        // Too close to be visible.
        if followed.is_none() {
            break;
        }
        let covariance = state.covariance();
        pairs.push(PeerStep {
            circles: circles.map(|circle| circle.map(Into::into)),
            ours: PeerState {
                t_ns: pair[1].t_ns(),
                x: state.x.into(),
                covariance: std::array::from_fn(|i| std::array::from_fn(|j| covariance[(i, j)])),
            },
            us,
        });
    }
    Ok(Some(PeerFilter { start, pairs }))
}

/// Runs the tracker on a ball among clutter.
fn tracked(
    throw: &StillThrow,
    robot: &Robot,
    config: TrackConfig,
) -> Result<Option<PeerTrack>, TrialError> {
    let tracked = throw.track(robot, config)?;
    let first = tracked.said.first().map(reported);
    let Some((start, judged_ns)) = first.zip(throw.judged_ns()) else {
        return Ok(None);
    };
    if start.t_ns >= judged_ns {
        return Ok(None);
    }
    let pairs = throw.pairs.iter().zip(&tracked.micros);
    Ok(Some(PeerTrack {
        start,
        pairs: pairs
            .filter(|(pair, _)| (start.t_ns + 1..=judged_ns).contains(&pair.t_ns()))
            .map(|(pair, us)| PeerPair {
                t_ns: pair.t_ns(),
                circles: pair.circles.each_ref().map(all),
                us: *us,
            })
            .collect(),
        ours: throw.ahead(&tracked).map(|(said, ahead)| PeerPrediction {
            state: reported(said),
            across_mm: ahead.across_mm,
            along_ms: ahead.along_ms,
            nees: ahead.nees,
        }),
    }))
}

fn head(pose: &HeadPose) -> Head {
    Head::new(pose).expect("the world's head has a pose")
}

fn all(circles: &Circles) -> Vec<[f64; 3]> {
    let circles = circles.valid().iter();
    circles
        .map(|circle| [circle.u, circle.v, circle.r])
        .collect()
}

/// Returns the circle of a picture that contains only the ball.
fn only(circles: &Circles) -> Option<Vector3<f64>> {
    let circle = circles.valid().first()?;
    Some(Vector3::new(circle.u, circle.v, circle.r))
}

fn reported(said: &TimedPrediction) -> PeerState {
    let BallPrediction {
        t_ns,
        p,
        v,
        k,
        lift,
        covariance,
        ..
    } = said.prediction;
    PeerState {
        t_ns,
        x: [
            p[0], p[1], p[2], v[0], v[1], v[2], k, lift[0], lift[1], lift[2],
        ],
        covariance,
    }
}

fn covariance(state: &PeerState) -> SMatrix<f64, STATES, STATES> {
    SMatrix::from_fn(|i, j| state.covariance[i][j])
}

#[cfg(test)]
mod tests {

    use super::*;

    /// If the tracker assigns all circles to the ball, the filter alone gives the same result.
    #[test]
    fn the_filter_alone_is_the_tracker_without_clutter() {
        let robot = Robot::nominal();
        let config = TrackConfig {
            // No circle is rejected as clutter.
            gate: 100.0,
            ..TrackConfig::default()
        };
        for number in 0..3 {
            let throw = StillThrow::new(&robot, Detectors::Perfect, 2, number).unwrap();
            let said = throw.track(&robot, config).unwrap().said;
            let filter = filtered(&throw, &robot, config).unwrap().unwrap();
            let mut compared = 0;
            for step in &filter.pairs {
                let Some(said) = said.iter().find(|said| said.exposure_ns == step.ours.t_ns) else {
                    continue;
                };
                let of_tracker = reported(said);
                for i in 0..STATES {
                    let sigma = step.ours.covariance[i][i].sqrt();
                    // Square roots of the first covariance differ by rounding errors.
                    assert!((step.ours.x[i] - of_tracker.x[i]).abs() < 1e-6 * sigma);
                }
                compared += 1;
            }
            assert!(compared > 8, "{compared}");
        }
    }
}
