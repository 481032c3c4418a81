//! Sequential quadratic programming from one start, as in [`plan`](crate::plan): linearised problems with an exact
//! penalty and a BFGS approximation of the Hessian.

use super::problem::{Linearised, Point, Problem, ROWS, THROW_UNKNOWNS, ThrowViolation};
use crate::plan::bfgs::update;
use crate::plan::qp::{self, Row};

#[derive(Debug, Clone, Copy)]
pub(crate) struct ThrowSolution {
    pub x: Point,
    pub cost: f64,
    pub violation: ThrowViolation,
}

/// Initial half width of a step's trust region, in rad, fractions and s.
const TRUST: f64 = 0.3;
/// Half width of the trust region below which the descent ends, in rad, fractions and s.
const LEAST_TRUST: f64 = 1e-6;
/// Step fractions that are tried.
const SHARES: [f64; 5] = [1.0, 0.4, 0.16, 0.064, 0.0256];
/// Decrease of the merit function below which a step counts as small, in units of the cost.
const SMALL_GAIN: f64 = 1e-7;

/// Descends from `start` with at most `most` quadratic programs. Returns the best feasible point and the number of
/// programs.
pub(crate) fn descend(
    problem: &Problem,
    start: &Point,
    most: usize,
) -> (Option<ThrowSolution>, usize) {
    let mut trust = TRUST;
    let mut x = *start;
    let mut best: Option<ThrowSolution> = None;
    let mut iterations = 0;
    let Some(mut here) = problem.linearise(&x, trust) else {
        return (None, 0);
    };
    let mut curvature = [[0.0; THROW_UNKNOWNS]; THROW_UNKNOWNS];
    for (i, line) in curvature.iter_mut().enumerate() {
        line[i] = 0.5;
    }
    let mut penalty: f64 = 1.0;
    let mut small_gains = 0;
    keep(&mut best, &x, &here);
    while iterations < most && trust > LEAST_TRUST && small_gains < 3 {
        iterations += 1;
        let equalities = problem.aim.equalities();
        let Some((step, multipliers)) = direction(&here, &curvature, equalities) else {
            break;
        };
        for u in multipliers.iter().flat_map(|u| &u[..here.own]) {
            penalty = penalty.max(1.5 * u.abs());
        }
        let merit = |at: &Linearised| at.cost + penalty * at.lack;
        let better = |there: &Linearised| {
            merit(there).is_finite() && merit(there) < merit(&here)
                || multipliers.is_none() && there.lack < 0.98 * here.lack
        };
        let found = SHARES.iter().find_map(|share| {
            let next: Point = std::array::from_fn(|i| x[i] + share * step[i]);
            let there = problem.linearise(&next, trust).filter(better)?;
            Some((next, there))
        });
        let Some((next, there)) = found else {
            trust *= 0.3;
            let Some(again) = problem.linearise(&x, trust) else {
                break;
            };
            here = again;
            continue;
        };
        if let Some(multipliers) = &multipliers {
            let (before, after) = (
                lagrangian_slope(&here, multipliers, equalities),
                lagrangian_slope(&there, multipliers, equalities),
            );
            update(
                &mut curvature,
                &std::array::from_fn(|i| next[i] - x[i]),
                &std::array::from_fn(|i| after[i] - before[i]),
            );
        }
        let gain = merit(&here) - merit(&there);
        small_gains = if gain < SMALL_GAIN {
            small_gains + 1
        } else {
            0
        };
        // After a long step, enlarge the trust region.
        let longest = (0..THROW_UNKNOWNS).fold(0.0f64, |a, i| a.max((next[i] - x[i]).abs()));
        if longest > 0.9 * trust {
            trust = (trust * 2.0).min(TRUST);
        }
        x = next;
        let Some(next) = problem.linearise(&x, trust) else {
            break;
        };
        here = next;
        keep(&mut best, &x, &here);
    }
    (best, iterations)
}

/// Returns the step of the quadratic program with its multipliers, or a restoring step if it has no solution.
fn direction(
    here: &Linearised,
    curvature: &[[f64; THROW_UNKNOWNS]; THROW_UNKNOWNS],
    equalities: usize,
) -> Option<(Point, Option<[f64; ROWS]>)> {
    let rows = &here.rows[..here.count];
    match qp::solve::<THROW_UNKNOWNS, ROWS>(curvature, &here.slope, rows, equalities) {
        Ok(step) => Some((step.x, Some(step.multipliers))),
        Err(_) => Some((restoring_step(here, equalities)?, None)),
    }
}

/// Returns the gradient of the Lagrangian, with the multipliers of the equations.
fn lagrangian_slope(at: &Linearised, multipliers: &[f64; ROWS], equalities: usize) -> Point {
    std::array::from_fn(|i| {
        let rows = at.rows[..equalities].iter().zip(multipliers);
        at.slope[i] - rows.map(|(row, u)| u * row.normal[i]).sum::<f64>()
    })
}

fn keep(best: &mut Option<ThrowSolution>, x: &Point, here: &Linearised) {
    if here.violation.is_feasible() && best.is_none_or(|found| here.cost < found.cost) {
        *best = Some(ThrowSolution {
            x: *x,
            cost: here.cost,
            violation: here.violation,
        });
    }
}

/// Returns the step that minimises the violations in the least-squares sense without violating other rows.
fn restoring_step(here: &Linearised, equalities: usize) -> Option<Point> {
    let lack = |i: usize, row: &Row<THROW_UNKNOWNS>| {
        (i < equalities || row.bound > 0.0).then_some(row.bound)
    };
    qp::least_violation::<THROW_UNKNOWNS, ROWS>(&here.rows[..here.count], lack, 0)
}
