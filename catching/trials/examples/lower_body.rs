//! Measures the benefit of planning platform and torso together with the arm. For balls with known flights, compares
//! the catches with a fixed lower body, with the rule, and with the best of many motions of the lower body.
//!
//!     cargo run --release -p tactnet-catching-trials --example lower_body -- THROWS SEED

use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use tactnet_catching::ChainDelays;
use tactnet_catching::Robot;
use tactnet_catching::coordinate::BodyMotion;
use tactnet_catching::flight::{DRAG, Flight, FlightPath, STEP};
use tactnet_catching::plan::{CatchRequest, Grid, Objective, PlanConfig, Planner};
use tactnet_catching::ramp::{Ramp, Reach};
use tactnet_catching_packets::{ARMS, JOINTS, joint};
use tactnet_catching_world::{World, WorldConfig};
use tactnet_plot::wilson_of_counts;

/// Search grid of all three variants.
const GRID: Grid = Grid {
    times: 30,
    hands: 24,
    elbows: 24,
};
/// Times after the start of the first path at which platform and torso stand still again, in s.
const ENDS: [f64; 4] = [0.15, 0.25, 0.35, 0.5];
/// Shares of the maximum distance of platform and torso within that time.
const SHARES: [f64; 7] = [-1.0, -0.67, -0.33, 0.0, 0.33, 0.67, 1.0];

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let numbers: Vec<u64> = std::env::args()
        .skip(1)
        .map(|argument| argument.parse())
        .collect::<Result<_, _>>()?;
    let [throws, seed] = numbers[..] else {
        return Err("expected THROWS SEED".into());
    };
    let robot = Robot::nominal();
    let planners: [Planner; ARMS] =
        std::array::from_fn(|arm| Planner::new(&robot, arm, PlanConfig::default()));
    let possible: Vec<[bool; 3]> = (0..throws)
        .into_par_iter()
        .map(|number| {
            let world_seed = seed.wrapping_mul(1_000_003).wrapping_add(number);
            let flight = flight(&robot, world_seed);
            ways(&robot, &planners, &flight)
        })
        .collect();
    for (name, way) in ["stands", "rule", "best of many"].iter().zip(0..) {
        let count = possible.iter().filter(|possible| possible[way]).count();
        let [low, high] = wilson_of_counts(count, possible.len());
        println!("{name}: {count} of {throws}, {low:.4} to {high:.4}");
    }
    let more = possible
        .iter()
        .filter(|[_, rule, best]| *best && !rule)
        .count();
    println!("caught by the best of many and not by the rule: {more} of {throws}");
    Ok(())
}

/// Returns the true flight from the earliest start of a path on, every 10 ms, in the inertial frame.
fn flight(robot: &Robot, seed: u64) -> Vec<Flight> {
    let world = World::new(
        robot.description(),
        &WorldConfig::default(),
        seed,
        &robot.waiting(),
    );
    let mut world = world.expect("settings are the ones built in");
    world.throw(1);
    let reaction = ChainDelays::ours().reaction(robot.description().cameras.rate);
    let samples = world.true_flight(0).unwrap_or_default();
    samples
        .iter()
        .skip((reaction * 1e3) as usize)
        .step_by(10)
        .map(|sample| Flight {
            p: sample.state.position,
            v: sample.state.velocity,
            // Only between samples of 10 ms.
            k: DRAG,
            lift: Vector3::zeros(),
        })
        .collect()
}

/// Returns true for each variant that can catch the ball: fixed lower body, rule, best of many motions.
fn ways(robot: &Robot, planners: &[Planner; ARMS], flight: &[Flight]) -> [bool; 3] {
    if flight.is_empty() {
        return [false; 3];
    }
    let ready = robot.waiting();
    let seen = FlightPath::recorded(&in_chest(robot, &ready, flight));
    let standing = BodyMotion::standing(&ready);
    let catches = |body: &BodyMotion| catches(robot, planners, flight, &ready, body);
    let stands = catches(&standing);
    let rule = stands || catches(&BodyMotion::towards(robot, &ready, &seen, 0));
    let best = rule || motions(robot, &ready).iter().any(catches);
    [stands, rule, best]
}

fn motions(robot: &Robot, ready: &[f64; JOINTS]) -> Vec<BodyMotion> {
    let limits = robot.joints();
    let to = |index: usize, end: f64, share: f64| {
        let joint = &limits[index];
        let far = ready[index] + share * Reach::new(end, 0.0, joint).high;
        let there = far.clamp(joint.range[0], joint.range[1]);
        Ramp::between(ready[index], 0.0, there, end, joint.speed)
    };
    let mut motions = Vec::new();
    for end in ENDS {
        for roll in SHARES {
            for turn in SHARES {
                motions.push(BodyMotion {
                    start_ns: 0,
                    platform: to(joint::PLATFORM, end, roll),
                    turn: to(joint::TORSO.start, end, turn),
                });
            }
        }
    }
    motions
}

fn catches(
    robot: &Robot,
    planners: &[Planner; ARMS],
    flight: &[Flight],
    ready: &[f64; JOINTS],
    body: &BodyMotion,
) -> bool {
    let mut q = *ready;
    body.write(body.end_ns() + 1, &mut q, &mut [0.0; JOINTS]);
    let path = FlightPath::recorded(&in_chest(robot, &q, flight));
    let latest = (flight.len() as f64 * STEP).min(1.8);
    let earliest = body.end_ns() as f64 * 1e-9;
    earliest < latest
        && planners.iter().enumerate().any(|(arm, planner)| {
            let own = joint::ARM[arm].start;
            let request = CatchRequest {
                ball: path.at(0.0),
                q0: std::array::from_fn(|i| ready[own + i]),
                w0: [0.0; 7],
                earliest,
                latest,
                objective: Objective::Latest,
                other: None,
            };
            planner.best_on_path(&request, &path, GRID).is_ok()
        })
}

fn in_chest(robot: &Robot, q: &[f64; JOINTS], flight: &[Flight]) -> Vec<Flight> {
    let to_chest = robot.chest(q).inverse();
    let moved = |ball: &Flight| Flight {
        p: (to_chest * Point3::from(ball.p)).coords,
        v: to_chest.rotation * ball.v,
        k: ball.k,
        lift: to_chest.rotation * ball.lift,
    };
    flight.iter().map(moved).collect()
}
