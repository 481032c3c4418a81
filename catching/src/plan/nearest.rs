//! Nearest miss: the motion that comes closest to a catch if no exact catch exists.
//!
//! Equation 3.2 of the thesis demands the hand exactly at the ball and exactly against its flight. A hand catches a
//! ball that is 2 cm off and 25 degrees aslant. An arm that already moves at its limits may have no exact catch left
//! after a small change of the prediction, but should still correct its motion. The equations therefore become a sum of
//! squares,
//!
//! ```text
//! minimise  |p(q) - b(t)|^2 / (5 mm)^2 + (u_x^2 + u_y^2) / 0.15^2      subject to all 31 inequalities,
//! ```
//!
//! which Gauss-Newton steps minimise with the same quadratic programs and limits as an exact plan.

use tactnet_catching_packets::ARM_JOINTS;

use super::catch_motion::{Point, UNKNOWNS};
use super::problem::{EQUALITIES, Linearised, Problem, ROWS};
use super::qp;
use super::sqp::{Solution, shares};

/// Weights of the squared errors: 1/m^2 for the position, dimensionless for the axis.
const WEIGHTS: [f64; EQUALITIES] = [4e4, 4e4, 4e4, 44.4, 44.4];
/// Half width of a step's trust region, in rad and s.
const TRUST: f64 = 0.3;
const STEPS: usize = 12;
/// Relative decrease below which the search ends.
const SMALL_GAIN: f64 = 1e-3;
/// Regularisation that limits steps along directions without effect.
const RIDGE: f64 = 1e-2;
/// Maximum position error in m and angle error in rad of a useful miss.
const MAX_MISS: [f64; 2] = [0.15, 0.6];
/// Base cost of a miss, which exceeds the cost of any catch.
const BASE_COST: f64 = 10.0;
const COST_PER_METRE: f64 = 100.0;

/// Returns the nearest miss found from `start`, or `None` if it misses by too much.
pub(crate) fn approach(
    problem: &Problem,
    start: &Point,
    mut out_of_time: impl FnMut() -> bool,
) -> Option<Solution> {
    let mut x = within_limits(problem, start)?;
    let mut here = problem.linearise(&x, TRUST);
    let mut miss = square(&here);
    let mut kept = is_kept(problem, &x).then_some(x);
    for _ in 0..STEPS {
        if out_of_time() {
            break;
        }
        let (curvature, slope) = normal_equations(&here);
        let rows = &here.rows[EQUALITIES..here.count];
        let Ok(step) = qp::solve::<UNKNOWNS, ROWS>(&curvature, &slope, rows, 0) else {
            break;
        };
        let next = shares().find_map(|share| {
            let there: Point = std::array::from_fn(|i| x[i] + share * step.x[i]);
            let there = within_limits(problem, &there)?;
            let linearised = problem.linearise(&there, TRUST);
            let nearer = square(&linearised) < miss;
            (nearer && (kept.is_none() || is_kept(problem, &there))).then_some((there, linearised))
        });
        let Some((next, linearised)) = next else {
            break;
        };
        let gain = miss - square(&linearised);
        (x, here, miss) = (next, linearised, miss - gain);
        if is_kept(problem, &x) {
            kept = Some(x);
        }
        if gain < SMALL_GAIN * miss {
            break;
        }
    }
    let x = kept?;
    let violation = problem.violation(&x);
    (violation.position <= MAX_MISS[0] && violation.angle <= MAX_MISS[1]).then_some(Solution {
        x,
        cost: BASE_COST + COST_PER_METRE * violation.position + violation.angle,
        violation,
    })
}

fn square(at: &Linearised) -> f64 {
    // The bound of an equation is its negative error.
    at.rows[..EQUALITIES]
        .iter()
        .zip(WEIGHTS)
        .map(|(row, weight)| weight * row.bound * row.bound)
        .sum()
}

fn normal_equations(at: &Linearised) -> ([[f64; UNKNOWNS]; UNKNOWNS], [f64; UNKNOWNS]) {
    let mut curvature = [[0.0; UNKNOWNS]; UNKNOWNS];
    let mut slope = [0.0; UNKNOWNS];
    for i in 0..UNKNOWNS {
        curvature[i][i] = RIDGE;
    }
    for (row, weight) in at.rows[..EQUALITIES].iter().zip(WEIGHTS) {
        for i in 0..UNKNOWNS {
            slope[i] -= weight * row.bound * row.normal[i];
            for k in 0..UNKNOWNS {
                curvature[i][k] += weight * row.normal[i] * row.normal[k];
            }
        }
    }
    (curvature, slope)
}

/// Clamps each joint to its reachable interval. Returns `None` if an interval is empty.
fn within_limits(problem: &Problem, x: &Point) -> Option<Point> {
    let mut x = *x;
    if !x.iter().all(|x| x.is_finite()) {
        return None;
    }
    x[ARM_JOINTS] = x[ARM_JOINTS].max(problem.times[0]).min(problem.times[1]);
    for i in 0..ARM_JOINTS {
        let [low, high] = problem.interval(i, x[ARM_JOINTS]);
        if low > high {
            return None;
        }
        x[i] = x[i].clamp(low, high);
    }
    Some(x)
}

/// Returns true if the motion keeps ranges, bodies and obstacles.
fn is_kept(problem: &Problem, x: &Point) -> bool {
    problem.violation(x).limits <= 1e-7 && problem.is_clear(x)
}
