//! Writes catch problems for other planners as JSON, with initial values and the solutions of this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_problems -- PROBLEMS SEED > problems.json

use std::time::Instant;

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::plan::{BODIES, Body, Objective, PlanConditions, PlanConfig, Planner};
use tactnet_catching_trials::{PlanProblem, plan_problem};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = || arguments.next().ok_or("expected PROBLEMS SEED");
    let (count, seed): (usize, u64) = (number()?.parse()?, number()?.parse()?);
    let robot = Robot::nominal();
    let problems = peer_problems(&robot, Objective::Soft, seed, count);
    println!("{}", serde_json::to_string(&problems)?);
    Ok(())
}

/// A catch problem with its solution, in SI units. Ball and arm are in the chest frame.
#[derive(Debug, Clone, Serialize)]
struct PeerProblem {
    /// Number of the problem.
    number: u64,
    /// Arm, 0 for left and 1 for right.
    arm: usize,
    /// Position of the ball at the start of the motion.
    p: [f64; 3],
    /// Velocity of the ball.
    v: [f64; 3],
    /// Drag of the ball, in 1/m.
    k: f64,
    /// Joint angles at the start of the motion.
    q0: [f64; 7],
    /// Joint rates at the start of the motion.
    w0: [f64; 7],
    /// Latest time of the catch.
    latest: f64,
    /// Bodies that the hand must avoid.
    bodies: [Body; BODIES],
    /// Initial joint angles and times of the descents, the best first.
    starts: Vec<([f64; 7], f64)>,
    /// Solution of this project; `None` if it found none.
    ours: Option<PeerAnswer>,
}

/// A plan.
#[derive(Debug, Clone, Serialize)]
struct PeerAnswer {
    /// Joint angles at the catch.
    q: [f64; 7],
    /// Time of the catch.
    t: f64,
    /// Cost.
    cost: f64,
    /// Computation time on one core including the grid, in ms.
    ms: f64,
}

/// Returns the first `count` problems of a seed that have initial values.
fn peer_problems(robot: &Robot, objective: Objective, seed: u64, count: usize) -> Vec<PeerProblem> {
    // The optimisation problem of the thesis includes only the hand's distance from the chest, and is short enough to
    // be implemented for peers.
    let config = PlanConfig {
        clearance: 0.0,
        ..PlanConfig::default()
    };
    let planners: [Planner; 2] = std::array::from_fn(|arm| Planner::new(robot, arm, config));
    (0..)
        .filter_map(|number| {
            let PlanProblem { arm, request } = plan_problem(robot, objective, seed, number);
            let starts = planners[arm]
                .starts(&request)
                .ok()
                .filter(|starts| !starts.is_empty())?;
            let begun = Instant::now();
            let plan = planners[arm].plan(&request, &PlanConditions::default(), || false);
            let ms = begun.elapsed().as_secs_f64() * 1e3;
            Some(PeerProblem {
                number,
                arm,
                p: request.ball.p.into(),
                v: request.ball.v.into(),
                k: request.ball.k,
                q0: request.q0,
                w0: request.w0,
                latest: request.latest,
                bodies: Body::around_chest(arm),
                starts: starts.iter().map(|start| (start.q, start.t)).collect(),
                ours: plan.ok().map(|plan| PeerAnswer {
                    q: plan.q,
                    t: plan.t,
                    cost: plan.cost,
                    ms,
                }),
            })
        })
        .take(count)
        .collect()
}
