//! Benchmark of the planner: computation time, missed solutions, and cost relative to the best known solution.

use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde::Serialize;
use tactnet_catching::Robot;
use tactnet_catching::plan::{
    CatchPlan, CatchPoint, CatchRequest, Grid, NoPlan, Objective, PlanConditions, PlanConfig,
    Planner, Share,
};

use crate::problems::{PlanProblem, plan_problem};
use tactnet_plot::Quantiles;

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
    /// Number of planners that share the search of a first plan, each on a thread.
    pub planners: usize,
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
    /// Number of planners that share the search of a first plan, each on a thread.
    pub planners: usize,
    /// Computation times of first plans, in ms.
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

/// Problem with the solutions of the dense grid.
struct Judged {
    problem: PlanProblem,
    number: u64,
    on_grid: bool,
    best_cost: Option<f64>,
}

/// Planners of both arms, threads for them, and planners with a dense grid and 32 descents.
struct Planners {
    own: [Planner; 2],
    threads: ThreadPool,
    oracles: [Planner; 2],
    grid: Grid,
}

/// Times and numbers so far.
#[derive(Default)]
struct Tally {
    first_ms: Vec<f64>,
    replan_ms: Vec<f64>,
    gaps: Vec<f64>,
    done: usize,
    missed: usize,
    beyond_oracle: usize,
    replans_missed: usize,
}

impl PlanBench {
    /// Runs the benchmark. `progress` receives the number of finished problems.
    pub fn run(&self, robot: &Robot, mut progress: impl FnMut(usize)) -> PlanReport {
        let planners = self.planners(robot);
        let mut tally = Tally::default();
        let mut drawn = 0;
        while tally.done < self.problems {
            let wanted = (self.problems - tally.done).min(200);
            let judged: Vec<Judged> = (drawn..drawn + wanted)
                .into_par_iter()
                .map(|number| self.judge(robot, &planners, number as u64))
                .collect();
            drawn += wanted;
            // Sequential, because it is timed.
            for judged in &judged {
                self.time(&planners, judged, &mut tally);
            }
            progress(tally.done);
        }
        let [cost_gap_p50, cost_gap_p99] =
            Quantiles::of(tally.gaps).map_or([0.0; 2], |gap| [gap.p50, gap.p99]);
        PlanReport {
            problems: tally.done,
            drawn,
            seed: self.seed,
            objective: self.objective,
            planners: self.planners,
            first_plan_ms: Quantiles::of(tally.first_ms).expect("at least one problem was solved"),
            replan_ms: Quantiles::of(tally.replan_ms),
            missed: tally.missed,
            missed_of_feasible: tally.missed as f64 / tally.done as f64,
            beyond_oracle: tally.beyond_oracle,
            replans_missed: tally.replans_missed,
            cost_gap_p50,
            cost_gap_p99,
        }
    }

    fn planners(&self, robot: &Robot) -> Planners {
        let grid = Grid {
            times: 40,
            hands: 36,
            elbows: 36,
        };
        let oracle = PlanConfig {
            first: grid,
            starts: 32,
            iterations: 100,
            ..PlanConfig::default()
        };
        Planners {
            own: std::array::from_fn(|arm| Planner::new(robot, arm, PlanConfig::default())),
            threads: ThreadPoolBuilder::new()
                .num_threads(self.planners)
                .build()
                .expect("the system has threads"),
            oracles: std::array::from_fn(|arm| Planner::new(robot, arm, oracle)),
            grid,
        }
    }

    fn judge(&self, robot: &Robot, planners: &Planners, number: u64) -> Judged {
        let problem = plan_problem(robot, self.objective, self.seed, number);
        let oracle = &planners.oracles[problem.arm];
        let on_grid = oracle
            .best_on_grid(&problem.request, None, planners.grid)
            .is_ok();
        let best = oracle.plan(&problem.request, &PlanConditions::default(), || false);
        Judged {
            problem,
            number,
            on_grid,
            best_cost: best.ok().map(|plan| plan.cost),
        }
    }

    /// Times the first plan of a problem and its correction one picture later.
    fn time(&self, planners: &Planners, judged: &Judged, tally: &mut Tally) {
        let PlanProblem { arm, request } = &judged.problem;
        let planner = &planners.own[*arm];
        let begun = Instant::now();
        let plan = self.first_plan(&planners.threads, planner, request);
        let took = begun.elapsed().as_secs_f64() * 1e3;
        let Ok(plan) = plan else {
            if judged.on_grid {
                tally.first_ms.push(took);
                tally.missed += 1;
                tally.done += 1;
            }
            return;
        };
        tally.first_ms.push(took);
        tally.done += 1;
        tally.beyond_oracle += usize::from(!judged.on_grid);
        if let Some(best) = judged.best_cost {
            tally.gaps.push(((plan.cost - best) / best.abs()).max(0.0));
        }
        if plan.t < 2.0 * FRAME {
            return;
        }
        let moved = self.moved_by_a_picture(request, &plan.ramps, judged.number);
        let conditions = PlanConditions {
            last: Some(CatchPoint {
                q: plan.q,
                t: plan.t - FRAME,
            }),
            ..PlanConditions::default()
        };
        let begun = Instant::now();
        let next = planner.plan(&moved, &conditions, || false);
        tally.replan_ms.push(begun.elapsed().as_secs_f64() * 1e3);
        let possible = || {
            let oracle = &planners.oracles[*arm];
            oracle.plan(&moved, &conditions, || false).is_ok()
        };
        tally.replans_missed += usize::from(next.is_err() && possible());
    }

    /// Returns the best plan of planners that share the search.
    fn first_plan(
        &self,
        threads: &ThreadPool,
        planner: &Planner,
        request: &CatchRequest,
    ) -> Result<CatchPlan, NoPlan> {
        let of = self.planners;
        if of == 1 {
            return planner.plan(request, &PlanConditions::default(), || false);
        }
        let part = |index| {
            let conditions = PlanConditions {
                share: Share { index, of },
                ..PlanConditions::default()
            };
            planner.plan(request, &conditions, || false)
        };
        let plans: Vec<_> = threads.install(|| (0..of).into_par_iter().map(part).collect());
        let cost = |plan: &Result<CatchPlan, _>| plan.as_ref().map_or(f64::INFINITY, |it| it.cost);
        let best = plans.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
        best.expect("there is a planner")
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
