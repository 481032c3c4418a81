//! Writes throw problems for other planners as JSON, with initial values and the solutions of this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_throws -- THROWS SEED > throws.json

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
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

/// Returns `count` throws of maximum distance with their solutions, in SI units, inertial frame.
///
/// `starts` are initial angles of turn and arm, shares of their maximum speeds, and time, the best first; `unknowns` is
/// the solution in the same order, found in `ms` ms on one core. Joint speeds are constant for `coast` s about the
/// release; `palm` is the maximum angle between the hand's axis and the ball's velocity.
///
/// # Errors
/// A throw that cannot be planned.
fn peer_throws(robot: &Robot, seed: u64, count: usize) -> Result<Vec<Value>, TrialError> {
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
            let request = ThrowRequest::new(number % ARMS, Aim::Farthest { heading, height });
            let begun = Instant::now();
            let plan = thrower.plan(&request)?;
            let ms = begun.elapsed().as_secs_f64() * 1e3;
            Ok(json!({
                "arm": number % ARMS,
                "heading": heading,
                "height": height,
                "drag": DRAG,
                "coast": config.coast,
                "palm": config.palm,
                "starts": thrower.starts(&request)?,
                "unknowns": plan.unknowns.as_slice(),
                "distance": plan.distance(),
                "ms": ms,
            }))
        })
        .collect()
}
