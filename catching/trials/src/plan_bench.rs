//! Benchmark of the planner: computation time, missed solutions, and cost relative to the best known solution.

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::plan::{
    CatchPoint, CatchRequest, Grid, Objective, PlanConditions, PlanConfig, Planner,
};

use crate::problems::{PlanProblem, plan_problem};
use crate::quantiles::Quantiles;

/// Time between two pictures in s, and thus between a plan and its correction.
const FRAME: f64 = 0.04;

/// Settings of the benchmark.
#[derive(Debug, Clone, Copy)]
pub struct PlanBench {
    /// Number of feasible problems.
    pub problems: usize,
    /// Seed of the problems.
    pub seed: u64,
    /// Objective of the plans.
    pub objective: Objective,
    /// Settings of the planner.
    pub config: PlanConfig,
}

/// Results.
#[derive(Debug, Clone, Serialize)]
pub struct PlanReport {
    /// Number of problems that a dense grid or the planner solves.
    pub problems: usize,
    /// Number of drawn problems, including infeasible ones.
    pub drawn: usize,
    /// Seed of the problems.
    pub seed: u64,
    /// Objective of the plans.
    pub objective: Objective,
    /// Computation times of first plans on one core, in ms.
    pub first_plan_ms: Quantiles,
    /// Computation times of plans one picture later, which start from the previous plan, on one core, in ms.
    pub replan_ms: Option<Quantiles>,
    /// Number of problems that only the dense grid solves.
    pub missed: usize,
    /// `missed` divided by `problems`.
    pub missed_of_feasible: f64,
    /// Number of problems that only the planner solves.
    pub beyond_oracle: usize,
    /// Number of replans without a solution where the dense grid with 32 descents has one.
    pub replans_missed: usize,
    /// Median of the relative excess cost over the best known solution (dense grid with 32 descents).
    pub cost_gap_p50: f64,
    /// 99th percentile of the relative excess cost.
    pub cost_gap_p99: f64,
}

struct Judged {
    problem: PlanProblem,
    on_grid: bool,
    best_cost: Option<f64>,
}

impl PlanBench {
    /// Runs the benchmark. `progress` receives the number of finished problems.
    pub fn run(&self, robot: &Robot, mut progress: impl FnMut(usize)) -> PlanReport {
        let planners: [Planner; 2] =
            std::array::from_fn(|arm| Planner::new(robot, arm, self.config));
        let oracle_config = PlanConfig {
            first: Grid {
                times: 40,
                hands: 36,
                elbows: 36,
            },
            starts: 32,
            iterations: 100,
            ..self.config
        };
        let oracles: [Planner; 2] =
            std::array::from_fn(|arm| Planner::new(robot, arm, oracle_config));
        let mut first = Vec::new();
        let mut again = Vec::new();
        let mut gaps = Vec::new();
        let (mut done, mut drawn, mut missed, mut beyond_oracle, mut replans_missed) =
            (0, 0, 0, 0, 0);
        while done < self.problems {
            let from = drawn;
            let wanted = (self.problems - done).min(200);
            let judged: Vec<Judged> = (from..from + wanted)
                .into_par_iter()
                .map(|number| {
                    let problem = plan_problem(robot, self.objective, self.seed, number as u64);
                    let oracle = &oracles[problem.arm];
                    let on_grid = oracle
                        .best_on_grid(&problem.request, oracle_config.first)
                        .is_ok();
                    let best = oracle
                        .plan(&problem.request, &PlanConditions::default(), || false)
                        .ok();
                    Judged {
                        problem,
                        on_grid,
                        best_cost: best.map(|plan| plan.cost),
                    }
                })
                .collect();
            drawn += wanted;
            // Sequential, because it is timed.
            for (offset, judged) in judged.iter().enumerate() {
                let PlanProblem { arm, request } = &judged.problem;
                let planner = &planners[*arm];
                let begun = Instant::now();
                let plan = planner.plan(request, &PlanConditions::default(), || false);
                let took = begun.elapsed().as_secs_f64() * 1e3;
                let Ok(plan) = plan else {
                    if judged.on_grid {
                        first.push(took);
                        missed += 1;
                        done += 1;
                    }
                    continue;
                };
                first.push(took);
                done += 1;
                beyond_oracle += usize::from(!judged.on_grid);
                if let Some(best) = judged.best_cost {
                    gaps.push(((plan.cost - best) / best.abs()).max(0.0));
                }
                if plan.t < 2.0 * FRAME {
                    continue;
                }
                let moved = self.moved_by_a_picture(request, &plan.ramps, (from + offset) as u64);
                let conditions = PlanConditions {
                    last: Some(CatchPoint {
                        q: plan.q,
                        t: plan.t - FRAME,
                    }),
                    ..PlanConditions::default()
                };
                let begun = Instant::now();
                let next = planner.plan(&moved, &conditions, || false);
                again.push(begun.elapsed().as_secs_f64() * 1e3);
                let possible = || oracles[*arm].plan(&moved, &conditions, || false).is_ok();
                replans_missed += usize::from(next.is_err() && possible());
            }
            progress(done);
        }
        let gap = Quantiles::of(gaps).unwrap_or(Quantiles {
            p50: 0.0,
            p99: 0.0,
            max: 0.0,
        });
        PlanReport {
            problems: done,
            drawn,
            seed: self.seed,
            objective: self.objective,
            first_plan_ms: Quantiles::of(first).expect("at least one problem was solved"),
            replan_ms: Quantiles::of(again),
            missed,
            missed_of_feasible: missed as f64 / done as f64,
            beyond_oracle,
            replans_missed,
            cost_gap_p50: gap.p50,
            cost_gap_p99: gap.p99,
        }
    }

    /// Returns the request one picture later: the arm has moved along its path, and the ball is seen slightly
    /// elsewhere.
    fn moved_by_a_picture(
        &self,
        request: &CatchRequest,
        ramps: &[tactnet_catching::ramp::Ramp; 7],
        number: u64,
    ) -> CatchRequest {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(u64::MAX - number);
        let mut ball = request.ball.after(FRAME);
        for i in 0..3 {
            ball.p[i] += rng.random_range(-0.005..0.005);
            ball.v[i] += rng.random_range(-0.02..0.02);
        }
        let joints: [(f64, f64); 7] = std::array::from_fn(|i| ramps[i].at(FRAME));
        CatchRequest {
            ball,
            q0: joints.map(|(q, _)| q),
            w0: joints.map(|(_, w)| w),
            ..*request
        }
    }
}
