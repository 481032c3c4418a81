//! How long plans take, how many are missed, and what they cost beside the best that is known.

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

/// Time between two pictures, s: how far a re-plan is from its plan.
const FRAME: f64 = 0.04;

/// What is measured.
#[derive(Debug, Clone, Copy)]
pub struct PlanBench {
    /// Problems that can be solved.
    pub problems: usize,
    /// Of the problems.
    pub seed: u64,
    /// Of the plans.
    pub objective: Objective,
    /// Of the planner.
    pub config: PlanConfig,
}

/// What was measured.
#[derive(Debug, Clone, Serialize)]
pub struct PlanReport {
    /// Problems that a dense grid or the planner solves.
    pub problems: usize,
    /// Problems that were drawn for it.
    pub drawn: usize,
    /// Of the problems.
    pub seed: u64,
    /// Of the plans.
    pub objective: Objective,
    /// First plans, ms, one core.
    pub first_plan_ms: Quantiles,
    /// Plans one picture later, from the last one, ms, one core.
    pub replan_ms: Option<Quantiles>,
    /// Problems that the dense grid solves and the planner does not.
    pub missed: usize,
    /// The same, as a share of `problems`.
    pub missed_of_feasible: f64,
    /// Problems that the planner solves and the dense grid does not.
    pub beyond_oracle: usize,
    /// Re-plans that found nothing where the dense grid with 32 descents does.
    pub replans_missed: usize,
    /// Cost over the best that is known (dense grid with 32 descents), as a share of that: median.
    pub cost_gap_p50: f64,
    /// The same, 99th percentile.
    pub cost_gap_p99: f64,
}

struct Judged {
    problem: PlanProblem,
    on_grid: bool,
    best_cost: Option<f64>,
}

impl PlanBench {
    /// Measures. `progress` is told how many problems are done.
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
            // Alone, since it is timed.
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

    /// The arm one picture further on its path, the ball seen a little elsewhere.
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
