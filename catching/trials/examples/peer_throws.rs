//! Writes throw problems for other planners as JSON, with initial values and the solutions of this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_throws -- THROWS SEED > throws.json

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::flight::DRAG;
use tactnet_catching::throw::{Aim, ThrowPlanConfig, ThrowRequest, Thrower};
use tactnet_catching_packets::ARMS;
use tactnet_catching_trials::TrialError;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().ok_or("expected THROWS SEED");
    let (count, seed): (usize, u64) = (number()?.parse()?, number()?.parse()?);
    let robot = Robot::nominal();
    let throws = peer_throws(&robot, seed, count)?;
    println!("{}", serde_json::to_string(&throws)?);
    Ok(())
}

/// A throw of maximum distance with its solution, in SI units, inertial frame.
#[derive(Debug, Clone, Serialize)]
struct PeerLaunch {
    /// Arm, 0 for left and 1 for right.
    arm: usize,
    /// Direction of the throw about the vertical, from straight ahead, in rad.
    heading: f64,
    /// Height at which the flight ends, in m.
    height: f64,
    /// Drag of the ball, in 1/m.
    drag: f64,
    /// Duration of constant joint speeds before and after the release, in s.
    coast: f64,
    /// Maximum angle between the hand's axis and the velocity of the ball, in rad.
    palm: f64,
    /// Initial angles of turn and arm, shares of their maximum speeds, and time; the best first.
    starts: Vec<Vec<f64>>,
    /// Solution of this project, in the same order.
    unknowns: Vec<f64>,
    /// Length of its flight, in m.
    distance: f64,
    /// Computation time on one core including the initial values, in ms.
    ms: f64,
}

/// Returns `count` throws.
///
/// # Errors
/// A throw that cannot be planned.
fn peer_throws(robot: &Robot, seed: u64, count: usize) -> Result<Vec<PeerLaunch>, TrialError> {
    // The exported problem has limits and flight, but not the robot's bodies, so that peers stay short.
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
