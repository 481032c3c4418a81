//! Sequential quadratic programming from one start. Each step solves a linearised problem and projects the result onto
//! the equations.

use tactnet_catching_packets::ARM_JOINTS;

use super::bfgs::update;
use super::objective::Objective;
use super::problem::{EQUALITIES, Linearised, Point, Problem, ROWS, UNKNOWNS, Violation};
use super::qp;

/// Feasible point with its cost.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Solution {
    pub x: Point,
    pub cost: f64,
    pub violation: Violation,
}

/// Result of one descent.
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
const DRAWN_IN: f64 = 1e-6;
/// Distance inside the limits that restoring steps aim at, in rad, m or s.
const MARGIN: f64 = 1e-4;
/// Step length below which the descent ends, in rad and s.
const SMALL_STEP: f64 = 1e-6;
/// Relative decrease of the merit function below which a step counts as small; costs are about 1.
const SMALL_GAIN: f64 = 1e-6;

/// Descends from `start`.
pub(crate) fn descend(
    problem: &Problem,
    start: &Point,
    most: usize,
    mut out_of_time: impl FnMut() -> bool,
) -> Descent {
    let mut x = problem.retract(start);
    let mut best: Option<Solution> = None;
    let mut iterations = 0;
    let mut here = problem.linearise(&x, TRUST);
    while here.lack > DRAWN_IN && iterations < RESTORATIONS && !out_of_time() {
        iterations += 1;
        let Some(next) = draw_in(problem, &here, &x) else {
            break;
        };
        let next = problem.retract(&next);
        let linearised = problem.linearise(&next, TRUST);
        if linearised.lack > 0.95 * here.lack {
            break;
        }
        (x, here) = (next, linearised);
    }
    let (mut cost, mut slope) = problem.cost(&x);
    let mut curvature = initial_curvature(problem, &x, cost);
    let mut penalty: f64 = 1.0;
    let keep = |best: &mut Option<Solution>, x: &Point, cost: f64| {
        let violation = problem.violation(x);
        if violation.is_feasible()
            && best.is_none_or(|found| cost < found.cost)
            && problem.is_clear(x)
        {
            *best = Some(Solution {
                x: *x,
                cost,
                violation,
            });
        }
    };
    keep(&mut best, &x, cost);
    let mut small_gains = 0;
    while iterations < most && !out_of_time() {
        iterations += 1;
        let rows = &here.rows[..here.count];
        let Ok(step) = qp::solve::<UNKNOWNS, ROWS>(&curvature, &slope, rows, EQUALITIES) else {
            break;
        };
        let length = step.x.iter().fold(0.0f64, |a, d| a.max(d.abs()));
        if length < SMALL_STEP {
            break;
        }
        penalty = step.multipliers[..here.count]
            .iter()
            .fold(penalty, |a, u| a.max(1.5 * u.abs()));
        let merit = cost + penalty * here.lack;
        let predicted =
            (0..UNKNOWNS).map(|i| slope[i] * step.x[i]).sum::<f64>() - penalty * here.lack;
        let mut share = 1.0;
        let next = loop {
            let there: Point = std::array::from_fn(|i| x[i] + share * step.x[i]);
            let there = problem.retract(&there);
            let (next_cost, next_slope) = problem.cost(&there);
            let linearised = problem.linearise(&there, TRUST);
            if next_cost.is_finite()
                && next_cost + penalty * linearised.lack
                    <= merit + 1e-4 * share * predicted.min(0.0)
            {
                break Some((there, next_cost, next_slope, linearised));
            }
            share *= 0.4;
            if share < 0.02 {
                break None;
            }
        };
        let Some((next, next_cost, next_slope, linearised)) = next else {
            break;
        };
        // Change of the Lagrangian's gradient along the step.
        let pull = |slope: &[f64; UNKNOWNS], rows: &[qp::Row<UNKNOWNS>]| -> [f64; UNKNOWNS] {
            std::array::from_fn(|i| {
                slope[i]
                    - rows[..EQUALITIES]
                        .iter()
                        .zip(&step.multipliers)
                        .map(|(row, u)| u * row.normal[i])
                        .sum::<f64>()
            })
        };
        let (before, after) = (
            pull(&slope, &here.rows),
            pull(&next_slope, &linearised.rows),
        );
        let moved: [f64; UNKNOWNS] = std::array::from_fn(|i| next[i] - x[i]);
        update(
            &mut curvature,
            &moved,
            &std::array::from_fn(|i| after[i] - before[i]),
        );
        let gain = merit - next_cost - penalty * linearised.lack;
        (x, cost, slope, here) = (next, next_cost, next_slope, linearised);
        keep(&mut best, &x, cost);
        small_gains = if gain < SMALL_GAIN * (1.0 + cost.abs()) {
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

/// Returns the step that minimises the violations of inequalities in the least-squares sense without violating others.
fn draw_in(problem: &Problem, here: &Linearised, x: &Point) -> Option<Point> {
    let mut b = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut g = [0.0; UNKNOWNS];
    for (i, line) in b.iter_mut().enumerate() {
        line[i] = 1e-3;
    }
    let mut rows = [qp::Row {
        normal: [0.0; UNKNOWNS],
        bound: 0.0,
    }; ROWS];
    let mut count = 0;
    for (i, row) in here.rows[..here.count].iter().enumerate() {
        // A positive bound is the violation.
        if i < EQUALITIES || row.bound <= 0.0 {
            rows[count] = *row;
            count += 1;
            continue;
        }
        let lack = row.bound + MARGIN;
        for k in 0..UNKNOWNS {
            g[k] -= lack * row.normal[k];
            for m in 0..UNKNOWNS {
                b[k][m] += row.normal[k] * row.normal[m];
            }
        }
    }
    let step = qp::solve::<UNKNOWNS, ROWS>(&b, &g, &rows[..count], EQUALITIES).ok()?;
    let mut next: Point = std::array::from_fn(|i| x[i] + step.x[i]);
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
        let t = x[ARM_JOINTS];
        let n = ARM_JOINTS as f64;
        for i in 0..ARM_JOINTS {
            let joint = &problem.joints[i];
            let shape = crate::ramp::Acceleration::new(
                x[i] - problem.request.q0[i],
                t,
                problem.request.w0[i],
                joint.speed,
            );
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
