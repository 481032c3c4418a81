//! Sequential quadratic programming from one start. Each step solves a linearised problem and projects the result onto
//! the equations.

use tactnet_catching_packets::ARM_JOINTS;

use super::bfgs::update;
use super::catch_motion::{Point, UNKNOWNS};
use super::objective::Objective;
use super::problem::{EQUALITIES, Linearised, Problem, ROWS, Violation};
use super::qp;

#[derive(Debug, Clone, Copy)]
pub(crate) struct Solution {
    pub x: Point,
    pub cost: f64,
    pub violation: Violation,
}

pub(crate) struct Descent {
    /// Best feasible point of the descent.
    pub best: Option<Solution>,
    /// Number of quadratic programs solved.
    pub iterations: usize,
}

/// Half width of a step's trust region, in rad and s.
const TRUST: f64 = 0.4;
/// Maximum number of steps that restore feasibility at the start.
const RESTORATIONS: usize = 10;
/// Sum of violations below which no feasibility is restored, in mixed units (rad, m, s).
const RESTORED: f64 = 1e-6;
/// Distance inside the limits that restoring steps aim at, in rad, m or s.
const MARGIN: f64 = 1e-4;
/// Step length below which the descent ends, in rad and s.
const SMALL_STEP: f64 = 1e-6;
/// Relative decrease of the merit function below which a step counts as small; costs are about 1.
const SMALL_GAIN: f64 = 1e-6;

/// Point of a descent with its linearised constraints, cost and gradient.
struct Iterate {
    x: Point,
    linearised: Linearised,
    cost: f64,
    slope: Point,
}

impl Iterate {
    fn new(problem: &Problem, x: Point, linearised: Linearised) -> Self {
        let (cost, slope) = problem.cost(&x);
        Self {
            x,
            linearised,
            cost,
            slope,
        }
    }

    fn merit(&self, penalty: f64) -> f64 {
        self.cost + penalty * self.linearised.lack
    }

    /// Returns the gradient of the Lagrangian, with the multipliers of the equations.
    fn lagrangian_slope(&self, multipliers: &[f64; ROWS]) -> Point {
        std::array::from_fn(|i| {
            self.slope[i]
                - self.linearised.rows[..EQUALITIES]
                    .iter()
                    .zip(multipliers)
                    .map(|(row, u)| u * row.normal[i])
                    .sum::<f64>()
        })
    }
}

pub(crate) fn descend(
    problem: &Problem,
    start: &Point,
    most: usize,
    mut out_of_time: impl FnMut() -> bool,
) -> Descent {
    let mut iterations = 0;
    let mut here = restore(problem, start, &mut iterations, &mut out_of_time);
    let mut curvature = initial_curvature(problem, &here.x, here.cost);
    let mut penalty: f64 = 1.0;
    let mut best: Option<Solution> = None;
    keep(problem, &mut best, &here);
    let mut small_gains = 0;
    while iterations < most && !out_of_time() {
        iterations += 1;
        let rows = &here.linearised.rows[..here.linearised.count];
        let Ok(step) = qp::solve::<UNKNOWNS, ROWS>(&curvature, &here.slope, rows, EQUALITIES)
        else {
            break;
        };
        let length = step.x.iter().fold(0.0f64, |a, d| a.max(d.abs()));
        if length < SMALL_STEP {
            break;
        }
        penalty = step.multipliers[..here.linearised.count]
            .iter()
            .fold(penalty, |a, u| a.max(1.5 * u.abs()));
        let Some(next) = line_search(problem, &here, &step.x, penalty) else {
            break;
        };
        let (before, after) = (
            here.lagrangian_slope(&step.multipliers),
            next.lagrangian_slope(&step.multipliers),
        );
        update(
            &mut curvature,
            &std::array::from_fn(|i| next.x[i] - here.x[i]),
            &std::array::from_fn(|i| after[i] - before[i]),
        );
        let gain = here.merit(penalty) - next.cost - penalty * next.linearised.lack;
        here = next;
        keep(problem, &mut best, &here);
        small_gains = if gain < SMALL_GAIN * (1.0 + here.cost.abs()) {
            small_gains + 1
        } else {
            0
        };
        if small_gains == 2 {
            break;
        }
    }
    Descent { best, iterations }
}

/// Projects the start onto the equations and reduces its violations of inequalities.
fn restore(
    problem: &Problem,
    start: &Point,
    iterations: &mut usize,
    out_of_time: &mut impl FnMut() -> bool,
) -> Iterate {
    let mut x = problem.retract(start);
    let mut linearised = problem.linearise(&x, TRUST);
    while linearised.lack > RESTORED && *iterations < RESTORATIONS && !out_of_time() {
        *iterations += 1;
        let Some(next) = restoring_step(problem, &linearised, &x) else {
            break;
        };
        let next = problem.retract(&next);
        let there = problem.linearise(&next, TRUST);
        if there.lack > 0.95 * linearised.lack {
            break;
        }
        (x, linearised) = (next, there);
    }
    Iterate::new(problem, x, linearised)
}

/// Returns the step fractions that are tried, from the full step on.
pub(super) fn shares() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(1.0), |share| Some(share * 0.4)).take_while(|share| *share >= 0.02)
}

/// Returns the longest tried fraction of a step that decreases the merit function sufficiently.
fn line_search(problem: &Problem, here: &Iterate, step: &Point, penalty: f64) -> Option<Iterate> {
    let merit = here.merit(penalty);
    let predicted = (0..UNKNOWNS).map(|i| here.slope[i] * step[i]).sum::<f64>()
        - penalty * here.linearised.lack;
    shares().find_map(|share| {
        let there: Point = std::array::from_fn(|i| here.x[i] + share * step[i]);
        let x = problem.retract(&there);
        let next = Iterate::new(problem, x, problem.linearise(&x, TRUST));
        let allowed = merit + 1e-4 * share * predicted.min(0.0);
        (next.cost.is_finite() && next.merit(penalty) <= allowed).then_some(next)
    })
}

/// Replaces the best solution by a cheaper feasible one.
fn keep(problem: &Problem, best: &mut Option<Solution>, here: &Iterate) {
    let found = problem.solution(&here.x, here.cost);
    if found.violation.is_feasible()
        && best.is_none_or(|best| found.cost < best.cost)
        && problem.is_clear(&found.x)
    {
        *best = Some(found);
    }
}

/// Returns the step that minimises the violations of inequalities in the least-squares sense without violating others.
fn restoring_step(problem: &Problem, here: &Linearised, x: &Point) -> Option<Point> {
    // A positive bound is the violation.
    let lack = |i: usize, row: &qp::Row<UNKNOWNS>| {
        (i >= EQUALITIES && row.bound > 0.0).then_some(row.bound + MARGIN)
    };
    let rows = &here.rows[..here.count];
    let step = qp::least_violation::<UNKNOWNS, ROWS>(rows, lack, EQUALITIES)?;
    let mut next: Point = std::array::from_fn(|i| x[i] + step[i]);
    // Limits may still be violated, but the time must stay valid.
    next[ARM_JOINTS] = next[ARM_JOINTS].max(problem.times[0]);
    Some(next)
}

/// Returns the Gauss-Newton part of the objective's Hessian plus a ridge.
fn initial_curvature(problem: &Problem, x: &Point, cost: f64) -> [[f64; UNKNOWNS]; UNKNOWNS] {
    let mut b = [[0.0; UNKNOWNS]; UNKNOWNS];
    for (i, line) in b.iter_mut().enumerate() {
        line[i] = 0.3;
    }
    if problem.request.objective == Objective::Soft {
        let n = ARM_JOINTS as f64;
        for i in 0..ARM_JOINTS {
            let joint = &problem.motion.joints[i];
            let shape = problem.motion.acceleration(x, i);
            let (d, dt) = (
                shape.by_distance / joint.acceleration,
                shape.by_time / joint.acceleration,
            );
            let weight = 1.0 / (n * cost.max(0.05));
            b[i][i] += weight * d * d;
            b[i][ARM_JOINTS] += weight * d * dt;
            b[ARM_JOINTS][i] += weight * d * dt;
            b[ARM_JOINTS][ARM_JOINTS] += weight * dt * dt;
        }
    }
    b
}
