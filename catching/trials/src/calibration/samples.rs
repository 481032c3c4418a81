//! The values that a calibration's means, medians and worst values are of.

use tactnet_catching::calibrate::{CalibrationConfig, Model, Problem, Session, Unknowns};

use crate::error::TrialError;

/// All values that a calibration's figures are of.
#[derive(Debug, Clone, Default)]
pub struct CalibrationSamples {
    /// Distances at unseen poses before, mm, two cameras a pose.
    pub raw_mm: Vec<f64>,
    /// The same after.
    pub found_mm: Vec<f64>,
    /// The same after a calibration from configurations that were not chosen.
    pub random_mm: Vec<f64>,
    /// From features to where the description puts them, pixels; 1000 where it sees none.
    pub before_px: Vec<f64>,
    /// From features to where the calibration puts them, pixels.
    pub residuals_px: Vec<f64>,
    /// Standard deviation of a feature's noise each way, pixels.
    pub noise_px: f64,
}

/// Returns lengths in mm.
///
/// - `metres`: the same in m
pub(crate) fn millimetres(metres: &[f64]) -> Vec<f64> {
    metres.iter().map(|length| 1e3 * length).collect()
}

/// Returns how far features are from where the description puts them, and from where `found` does, pixels.
///
/// # Errors
/// Where a setting makes no sense.
pub(crate) fn residuals(
    model: &Model,
    config: &CalibrationConfig,
    session: &Session,
    found: &Unknowns,
) -> Result<(Vec<f64>, Vec<f64>), TrialError> {
    let problem = Problem::new(model, session, config)?;
    Ok((
        problem.feature_residuals(&config.priors.guess()),
        problem.feature_residuals(found),
    ))
}
