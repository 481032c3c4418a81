//! Circles of throws for other trackers, with initial states and the results of this project.
//!
//! Everything is in SI units and pixels, in the inertial frame; `*_ns` in ns, `us` in µs, `across_mm` in mm, `along_ms`
//! in ms. A circle is `[u, v, r]`, a state `x` is position, velocity, drag (1/m) and lift (1/s). Pictures come in pairs,
//! left and right.

use std::time::Instant;

use nalgebra::{SMatrix, SVector, Vector3};
use serde::Serialize;
use serde_json::{Value, json};
use tactnet_catching::Robot;
use tactnet_catching::flight::{BALL_RADIUS, GRAVITY};
use tactnet_catching::track::{BallState, Camera, Head, STATES, TrackConfig};
use tactnet_catching_packets::packets::{BallPrediction, Circles, HeadPose};
use tactnet_catching_world::CamerasConfig;

use crate::error::TrialError;
use crate::look_ahead::TimedPrediction;
use crate::still_head::{StillThrow, perfect};

/// State of a ball, with its covariance row by row.
#[derive(Debug, Clone, Copy, Serialize)]
struct PeerState {
    t_ns: u64,
    x: [f64; STATES],
    covariance: [[f64; STATES]; STATES],
}

/// A single filter with known association of circles and ball: the tracker's first report, and the subsequent pictures.
#[derive(Debug, Clone, Serialize)]
struct PeerFilter {
    start: PeerState,
    pairs: Vec<PeerStep>,
}

/// A pair of pictures that contains only a ball, and the filter's state after it.
#[derive(Debug, Clone, Serialize)]
struct PeerStep {
    circles: [Option<[f64; 3]>; 2],
    ours: PeerState,
    us: f64,
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
) -> Result<Value, TrialError> {
    let cameras = &robot.description().cameras;
    let mut throws = Vec::with_capacity(count);
    for number in 0..count as u64 {
        throws.push(peer_throw(robot, config, seed, number)?);
        progress(throws.len());
    }
    let [left, right] = Camera::pair(cameras);
    let offsets: [[f64; 3]; 2] = [left.offset.into(), right.offset.into()];
    Ok(json!({
        "seed": seed,
        "cameras": {"offsets": offsets, "focal": left.focal, "size": left.size, "exposure": cameras.exposure},
        "gravity": GRAVITY,
        "ball_radius": BALL_RADIUS,
        "config": config,
        "throws": throws,
    }))
}

fn peer_throw(
    robot: &Robot,
    config: TrackConfig,
    seed: u64,
    number: u64,
) -> Result<Value, TrialError> {
    let alone = StillThrow::new(robot, perfect(), seed, number)?;
    let cluttered = StillThrow::new(robot, CamerasConfig::default(), seed, number)?;
    let head = head(&alone.pairs[0].head);
    let rotation: [[f64; 3]; 3] = head.rotation.transpose().into();
    Ok(json!({
        "number": number,
        "head": head.position.as_slice(),
        "head_rotation": rotation,
        "catch_ns": alone.catch_ns,
        "p": alone.catch.p.as_slice(),
        "v": alone.catch.v.as_slice(),
        "alone": filtered(&alone, robot, config)?,
        "cluttered": tracked(&cluttered, robot, config)?,
    }))
}

/// Runs the filter alone on a ball, circle by circle; `None` if the tracker never reported the ball.
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

/// Runs the tracker on a ball among clutter, up to the last pair at least 200 ms before the catch; `None` if it did not
/// report the ball before. `ours` is its prediction after the last pair and the error at the catch.
fn tracked(
    throw: &StillThrow,
    robot: &Robot,
    config: TrackConfig,
) -> Result<Option<Value>, TrialError> {
    let tracked = throw.track(robot, config)?;
    let first = tracked.said.first().map(reported);
    let Some((start, judged_ns)) = first.zip(throw.judged_ns()) else {
        return Ok(None);
    };
    if start.t_ns >= judged_ns {
        return Ok(None);
    }
    let pairs = throw.pairs.iter().zip(&tracked.micros);
    let pairs: Vec<Value> = pairs
        .filter(|(pair, _)| (start.t_ns + 1..=judged_ns).contains(&pair.t_ns()))
        .map(|(pair, us)| {
            json!({"t_ns": pair.t_ns(), "circles": pair.circles.each_ref().map(all), "us": us})
        })
        .collect();
    let ours = throw.ahead(&tracked).map(|(said, ahead)| {
        json!({
            "state": reported(said),
            "across_mm": ahead.across_mm,
            "along_ms": ahead.along_ms,
            "nees": ahead.nees,
        })
    });
    Ok(Some(json!({"start": start, "pairs": pairs, "ours": ours})))
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
            let throw = StillThrow::new(&robot, perfect(), 2, number).unwrap();
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
