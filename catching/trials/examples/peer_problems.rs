//! Writes catch problems for other planners as JSON, with initial values and the solutions of this project.
//!
//!     cargo run --release -p tactnet-catching-trials --example peer_problems -- PROBLEMS SEED > problems.json

use std::time::Instant;

use serde_json::{Value, json};
use tactnet_catching::Robot;
use tactnet_catching::plan::{Body, Objective, PlanConditions, PlanConfig, Planner};
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

/// Returns the first `count` problems of a seed that have initial values, in SI units; ball and arm are in the chest frame.
///
/// `q0` and `w0` are joint angles and rates at the start of the motion, `bodies` what the hand must avoid, `starts` the
/// initial joint angles and times of the descents, the best first. `ours` is the solution of this project, if it found
/// one, with its computation time on one core including the grid, in ms.
fn peer_problems(robot: &Robot, objective: Objective, seed: u64, count: usize) -> Vec<Value> {
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
            let starts: Vec<_> = starts.iter().map(|start| (start.q, start.t)).collect();
            let ours = plan
                .ok()
                .map(|plan| json!({"q": plan.q, "t": plan.t, "cost": plan.cost, "ms": ms}));
            Some(json!({
                "number": number,
                "arm": arm,
                "p": request.ball.p.as_slice(),
                "v": request.ball.v.as_slice(),
                "k": request.ball.k,
                "q0": request.q0,
                "w0": request.w0,
                "latest": request.latest,
                "bodies": Body::around_chest(arm),
                "starts": starts,
                "ours": ours,
            }))
        })
        .take(count)
        .collect()
}
