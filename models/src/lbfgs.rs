//! L-BFGS for smooth convex functions (Nocedal & Wright, Numerical Optimization, algorithm 7.5).

/// Number of stored pairs of step and gradient change.
///
/// It is large because a fit runs until the gradient vanishes and a step is cheaper than a gradient: a quadratic of condition number 4000
/// takes 218 gradients, against 626 with 12 pairs and a curvature constant of 0.9.
const MEMORY: usize = 40;
/// Armijo constant for sufficient decrease.
const DECREASE: f64 = 1e-4;
/// Relative rounding error of a function value; within it slopes decide (approximate Wolfe conditions; Hager & Zhang, 2005).
const ROUNDING: f64 = 1e-13;
/// Constant of the Wolfe curvature condition.
const CURVATURE: f64 = 0.5;

/// Result of a minimisation.
#[derive(Debug, Clone, PartialEq)]
pub struct Minimum {
    /// Point of the minimum.
    pub point: Vec<f64>,
    /// Euclidean norm of the gradient at `point`; a small norm proves the minimum of a convex function.
    pub gradient_norm: f64,
    /// Euclidean norm of the gradient at the start.
    pub start_norm: f64,
    /// Number of iterations.
    pub iterations: usize,
}

/// Minimises a convex function from `start`.
///
/// - `function(x, gradient)`: returns the value and writes the gradient
/// - `tolerance`: bound of the gradient's norm, relative to the larger of 1 and the norm of the point
///
/// Stops early if rounding prevents any further decrease; check `gradient_norm`.
pub fn minimise(
    start: Vec<f64>,
    mut function: impl FnMut(&[f64], &mut [f64]) -> f64,
    tolerance: f64,
    most_iterations: usize,
) -> Minimum {
    let size = start.len();
    let mut x = start;
    let mut gradient = vec![0.0; size];
    let mut value = function(&x, &mut gradient);
    let start_norm = dot(&gradient, &gradient).sqrt();
    let mut steps: Vec<Step> = Vec::new();
    let mut trial = vec![0.0; size];
    let mut trial_gradient = vec![0.0; size];
    for iteration in 0..most_iterations {
        let norm = dot(&gradient, &gradient).sqrt();
        if norm <= tolerance * dot(&x, &x).sqrt().max(1.0) {
            return Minimum {
                point: x,
                gradient_norm: norm,
                start_norm,
                iterations: iteration,
            };
        }
        let mut direction = direction(&gradient, &steps);
        let mut slope = dot(&direction, &gradient);
        if slope >= 0.0 {
            steps.clear();
            direction = gradient.iter().map(|g| -g).collect();
            slope = -norm * norm;
        }
        let first = if steps.is_empty() {
            (1.0 / norm).min(1.0)
        } else {
            1.0
        };
        let found = line_search(first, |length| {
            for i in 0..size {
                trial[i] = x[i] + length * direction[i];
            }
            let trial_value = function(&trial, &mut trial_gradient);
            let trial_slope = dot(&direction, &trial_gradient);
            let verdict = Verdict::of(value, slope, length, trial_value, trial_slope);
            if verdict == Verdict::Accepted {
                value = trial_value;
            }
            verdict
        });
        if !found {
            break;
        }
        remember(
            &mut steps,
            difference(&trial, &x),
            difference(&trial_gradient, &gradient),
        );
        x.copy_from_slice(&trial);
        gradient.copy_from_slice(&trial_gradient);
    }
    Minimum {
        gradient_norm: dot(&gradient, &gradient).sqrt(),
        start_norm,
        point: x,
        iterations: most_iterations,
    }
}

/// Step of the minimisation.
struct Step {
    step: Vec<f64>,
    /// Change of the gradient.
    change: Vec<f64>,
    /// Inverse of the product of `step` and `change`.
    inverse: f64,
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Stores a step of positive curvature in place of the oldest.
fn remember(steps: &mut Vec<Step>, step: Vec<f64>, change: Vec<f64>) {
    let curvature = dot(&step, &change);
    if curvature > 0.0 {
        if steps.len() == MEMORY {
            steps.remove(0);
        }
        steps.push(Step {
            step,
            change,
            inverse: 1.0 / curvature,
        });
    }
}

/// Assessment of a step by the weak Wolfe conditions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    TooLong,
    TooShort,
    Accepted,
}

impl Verdict {
    /// Assesses a step of `length` from a point with `value` and `slope` along the direction.
    fn of(value: f64, slope: f64, length: f64, trial_value: f64, trial_slope: f64) -> Self {
        // Near the minimum, function values differ only by rounding, but slopes are still accurate.
        let decreases = trial_value <= value + DECREASE * length * slope
            || trial_value <= value + ROUNDING * value.abs()
                && trial_slope <= (2.0 * DECREASE - 1.0) * slope;
        if !(trial_value.is_finite() && decreases) {
            Self::TooLong
        } else if trial_slope < CURVATURE * slope {
            Self::TooShort
        } else {
            Self::Accepted
        }
    }
}

/// Bisects between a step that is too long and one that is too short, starting with `length`; returns true if a step is accepted.
fn line_search(mut length: f64, mut assess: impl FnMut(f64) -> Verdict) -> bool {
    let (mut low, mut high) = (0.0, f64::INFINITY);
    for _ in 0..60 {
        match assess(length) {
            Verdict::TooLong => high = length,
            Verdict::TooShort => low = length,
            Verdict::Accepted => return true,
        }
        length = if high.is_finite() {
            f64::midpoint(low, high)
        } else {
            2.0 * low
        };
    }
    false
}

/// Returns minus the approximate inverse Hessian times the gradient.
fn direction(gradient: &[f64], steps: &[Step]) -> Vec<f64> {
    let mut q: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let mut factors = vec![0.0; steps.len()];
    for (factor, step) in factors.iter_mut().zip(steps).rev() {
        *factor = step.inverse * dot(&step.step, &q);
        add(&mut q, -*factor, &step.change);
    }
    if let Some(step) = steps.last() {
        let scale = 1.0 / (step.inverse * dot(&step.change, &step.change));
        q.iter_mut().for_each(|q| *q *= scale);
    }
    for (factor, step) in factors.iter().zip(steps) {
        let back = step.inverse * dot(&step.change, &q);
        add(&mut q, factor - back, &step.step);
    }
    q
}

/// Returns the dot product, summed in eight lanes.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_runs, b_runs) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest = a_runs.remainder().iter().zip(b_runs.remainder());
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (a, b) in a_runs.zip(b_runs) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}

fn add(sum: &mut [f64], factor: f64, values: &[f64]) {
    sum.iter_mut()
        .zip(values)
        .for_each(|(s, v)| *s += factor * v);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretched_bowl_is_minimised_to_rounding() {
        let scales: Vec<f64> = (0..30).map(|i| 10.0_f64.powf(f64::from(i) / 8.0)).collect();
        let minimum = minimise(
            vec![1.0; 30],
            |x, gradient| {
                let mut value = 0.0;
                for ((g, x), (i, scale)) in
                    gradient.iter_mut().zip(x).zip(scales.iter().enumerate())
                {
                    let away = x - i as f64;
                    *g = scale * away;
                    value += 0.5 * scale * away * away;
                }
                value
            },
            1e-10,
            500,
        );
        assert!(minimum.gradient_norm < 1e-7, "{minimum:?}");
        for (i, x) in minimum.point.iter().enumerate() {
            assert!((x - i as f64).abs() < 1e-7, "{x} {i}");
        }
    }
}
