//! Levenberg-Marquardt solver with covariance and quality of the solution.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::error::CalibrationError;
use super::model::Model;
use super::parameters::Calibration;
use super::problem::{CalibrationConfig, Normal, Problem};
use super::session::Session;
use super::unknowns::{UNKNOWNS, Unknowns, name};

/// Initial damping, relative to the diagonal.
const DAMPING: f64 = 1e-3;
/// Relative decrease of the cost below which the solver has converged.
const LEAST_GAIN: f64 = 1e-9;
/// Minimum absolute component of an eigenvector that is reported.
const MIN_COMPONENT: f64 = 0.25;
/// Median norm of two-dimensional normal noise with standard deviation 1.
const RAYLEIGH_MEDIAN: f64 = 1.177_410;

/// Solution of a calibration.
#[derive(Debug, Clone)]
pub struct Solved {
    /// Values of all unknowns.
    pub unknowns: Unknowns,
    /// Cost at the minimum.
    pub cost: f64,
    /// Number of iterations.
    pub iterations: usize,
    /// Covariance of the unknowns, `[UNKNOWNS][UNKNOWNS]`.
    pub covariance: DMatrix<f64>,
    /// Least-determined directions, worst first.
    pub worst: Vec<Determined>,
    /// Median feature residual, relative to the median of the noise.
    pub fit: f64,
    /// Fraction of features with residuals above five standard deviations.
    pub outlying: f64,
}

/// Direction in the space of unknowns, in standard deviations of their priors.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Determined {
    /// Standard deviation along the direction, relative to the prior; 1 means that the session carries no information.
    pub left: f64,
    /// Largest components of the unit vector: name of the unknown and its component.
    pub unknowns: Vec<(String, f64)>,
}

impl Solved {
    /// Returns the parameters.
    pub fn calibration(&self) -> Calibration {
        Calibration::of(&self.unknowns)
    }

    /// Returns the standard deviation of each unknown.
    pub fn sigmas(&self) -> Unknowns {
        self.covariance.diagonal().map(f64::sqrt)
    }
}

/// Calibrates a robot from a session.
///
/// - `last`: previous calibration, used as the initial guess
///
/// # Errors
/// Returns an error if the session cannot determine a calibration, the solver does not converge, the fit is poor, or a
/// parameter is implausible.
pub fn calibrate(
    model: &Model,
    session: &Session,
    config: &CalibrationConfig,
    last: Option<&Calibration>,
) -> Result<Solved, CalibrationError> {
    let problem = Problem::new(model, session, config)?;
    session.check(config.configurations)?;
    let solved = solve(&problem, last.map(Calibration::unknowns).as_ref())?;
    judge_fit(&solved, config)?;
    let deviations = problem.deviations(&solved.unknowns);
    let farthest = deviations.iamax();
    if deviations[farthest].abs() > config.plausible {
        return Err(CalibrationError::Implausible {
            unknown: name(farthest),
            found: solved.unknowns[farthest],
            sigmas: deviations[farthest].abs(),
            expected: config.plausible,
        });
    }
    Ok(solved)
}

/// Finds the minimum, starting from `start` or from the priors.
///
/// # Errors
/// Returns an error if the solver does not converge.
pub fn solve(problem: &Problem<'_>, start: Option<&Unknowns>) -> Result<Solved, CalibrationError> {
    let mut z = start.map_or_else(|| DVector::zeros(UNKNOWNS), |x| problem.deviations(x));
    let mut normal = problem.normal(&z);
    let mut damping = DAMPING;
    let most = problem.config().iterations;
    for iterations in 1..=most {
        let mut damped = normal.hessian.clone();
        for i in 0..UNKNOWNS {
            damped[(i, i)] *= 1.0 + damping;
        }
        // The priors make the matrix positive definite unless rounding interferes.
        let Some(factor) = damped.cholesky() else {
            damping *= 10.0;
            continue;
        };
        let step = -factor.solve(&normal.gradient);
        let gain = -step.dot(&normal.gradient) - step.dot(&(&normal.hessian * &step)) / 2.0;
        if gain < LEAST_GAIN * normal.cost {
            return Ok(solution(problem, &z, &normal, iterations));
        }
        let there = &z + &step;
        let cost = problem.cost(&there);
        if cost < normal.cost {
            z = there;
            normal = problem.normal(&z);
            damping = (damping / 10.0).max(1e-12);
        } else {
            damping *= 10.0;
        }
    }
    // A model that does not fit has a flat minimum; report the fit as the cause.
    let last = solution(problem, &z, &normal, most);
    judge_fit(&last, problem.config())?;
    Err(CalibrationError::NoMinimum { iterations: most })
}

fn judge_fit(solved: &Solved, config: &CalibrationConfig) -> Result<(), CalibrationError> {
    if solved.fit > config.fit {
        return Err(CalibrationError::Fit {
            found: solved.fit,
            expected: config.fit,
        });
    }
    Ok(())
}

fn solution(problem: &Problem<'_>, z: &DVector<f64>, normal: &Normal, iterations: usize) -> Solved {
    let eigen = normal.hessian.clone().symmetric_eigen();
    let mut order: Vec<usize> = (0..UNKNOWNS).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    let worst = order
        .iter()
        .take(5)
        .map(|&i| {
            let direction = eigen.eigenvectors.column(i);
            let mut parts: Vec<(String, f64)> = (0..UNKNOWNS)
                .filter(|unknown| direction[*unknown].abs() >= MIN_COMPONENT)
                .map(|unknown| (name(unknown), direction[unknown]))
                .collect();
            parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
            Determined {
                left: eigen.eigenvalues[i].max(1.0).sqrt().recip(),
                unknowns: parts,
            }
        })
        .collect();
    let scale = DMatrix::from_diagonal(problem.sigmas());
    let inverse = &eigen.eigenvectors
        * DMatrix::from_diagonal(&eigen.eigenvalues.map(f64::recip))
        * eigen.eigenvectors.transpose();
    let unknowns = problem.unknowns(z);
    let mut residuals = problem.feature_residuals(&unknowns);
    residuals.sort_by(f64::total_cmp);
    let noise = problem.config().noise.feature;
    let median = residuals.get(residuals.len() / 2).copied();
    let outlying = residuals.iter().filter(|r| **r > 5.0 * noise).count();
    Solved {
        cost: normal.cost,
        iterations,
        covariance: &scale * inverse * &scale,
        worst,
        fit: median.unwrap_or(0.0) / (RAYLEIGH_MEDIAN * noise),
        outlying: outlying as f64 / residuals.len().max(1) as f64,
        unknowns,
    }
}
