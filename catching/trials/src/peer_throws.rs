//! The same throws for other planners: what is asked for, where descents begin, and what ours found.

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::flight::DRAG;
use tactnet_catching::throw::{Aim, ThrowPlanConfig, ThrowRequest, Thrower};
use tactnet_catching_packets::ARMS;

use crate::error::TrialError;

/// A farthest throw in numbers, with our answer. SI units, inertial frame.
#[derive(Debug, Clone, Serialize)]
pub struct PeerLaunch {
    /// 0 left, 1 right.
    pub arm: usize,
    /// Where to, rad about the vertical from straight ahead.
    pub heading: f64,
    /// At which height the flight ends, m.
    pub height: f64,
    /// The ball's drag, 1/m.
    pub drag: f64,
    /// Joints keep their speeds so long before and after the release, s.
    pub coast: f64,
    /// Greatest angle between hand's axis and the ball's velocity, rad.
    pub palm: f64,
    /// Angles of turn and arm, shares of their speeds, time: the best first.
    pub starts: Vec<Vec<f64>>,
    /// Ours, in the same order.
    pub unknowns: Vec<f64>,
    /// Length of its flight, m.
    pub distance: f64,
    /// How long one core took, ms, starts and all.
    pub ms: f64,
}

/// Returns `count` throws.
///
/// # Errors
/// Where one is not found.
pub fn peer_throws(robot: &Robot, seed: u64, count: usize) -> Result<Vec<PeerLaunch>, TrialError> {
    // A peer is given limits and flight in a few lines, and not the robot's bodies.
    let config = ThrowPlanConfig {
        clearance: 0.0,
        margin: f64::NEG_INFINITY,
        ..ThrowPlanConfig::default()
    };
    let thrower = Thrower::new(robot, config);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|number| {
            let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
            let (heading, height) = (between(-0.5, 0.5), between(0.9, 1.3));
            let request = ThrowRequest {
                q: robot.waiting(),
                holding: Some(number % ARMS),
                aim: Aim::Farthest { heading, height },
                drag: DRAG,
                last: None,
            };
            let begun = Instant::now();
            let plan = thrower.plan(&request)?;
            let ms = begun.elapsed().as_secs_f64() * 1e3;
            Ok(PeerLaunch {
                arm: number % ARMS,
                heading,
                height,
                drag: DRAG,
                coast: config.coast,
                palm: config.palm,
                starts: thrower.starts(&request)?,
                unknowns: plan.unknowns.to_vec(),
                distance: plan.distance(),
                ms,
            })
        })
        .collect()
}
