//! The same problems for other planners: what is asked for, where descents begin, and what ours found.

use std::time::Instant;

use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::plan::{BODIES, Body, Objective, PlanConditions, PlanConfig, Planner};

use crate::problems::{PlanProblem, plan_problem};

/// A problem in numbers, with our answer. SI units; the ball and the arm in the chest's frame.
#[derive(Debug, Clone, Serialize)]
pub struct PeerProblem {
    /// Its number.
    pub number: u64,
    /// 0 left, 1 right.
    pub arm: usize,
    /// The ball's position when the motion begins.
    pub p: [f64; 3],
    /// Its velocity.
    pub v: [f64; 3],
    /// Its drag, 1/m.
    pub k: f64,
    /// Joint angles when the motion begins.
    pub q0: [f64; 7],
    /// Joint rates when the motion begins.
    pub w0: [f64; 7],
    /// No catch later.
    pub latest: f64,
    /// What the hand stays out of.
    pub bodies: [Body; BODIES],
    /// Joint angles and time that descents begin with, the best first.
    pub starts: Vec<([f64; 7], f64)>,
    /// Ours: joint angles, time, cost, and how long one core took, ms; `None` where it found nothing.
    pub ours: Option<PeerAnswer>,
}

/// A plan.
#[derive(Debug, Clone, Serialize)]
pub struct PeerAnswer {
    /// Joint angles.
    pub q: [f64; 7],
    /// Time of the catch.
    pub t: f64,
    /// Cost.
    pub cost: f64,
    /// How long it took, ms, grid and all.
    pub ms: f64,
}

/// Returns the first `count` problems of a seed that have starts.
pub fn peer_problems(
    robot: &Robot,
    objective: Objective,
    seed: u64,
    count: usize,
) -> Vec<PeerProblem> {
    // The programme of the thesis, which peers can be given in a few lines, knows the hand's distance from the chest only.
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
