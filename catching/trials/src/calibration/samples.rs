//! Individual values behind the statistics of a calibration.

use tactnet_catching::calibrate::{CalibrationConfig, Model, Problem, Session, Unknowns};

use crate::error::TrialError;

/// All values behind the statistics of a calibration.
#[derive(Debug, Clone, Default)]
pub struct CalibrationSamples {
    /// Distances in held-out poses before the calibration in mm, two cameras per pose.
    pub raw_mm: Vec<f64>,
    /// Distances after the calibration, in mm.
    pub found_mm: Vec<f64>,
    /// Distances after a calibration from random configurations, in mm.
    pub random_mm: Vec<f64>,
    /// Residuals of features with the description, in pixels; 1000 if the model does not see the marker.
    pub before_px: Vec<f64>,
    /// Residuals of features with the calibration, in pixels.
    pub residuals_px: Vec<f64>,
    /// Standard deviation of the noise of a feature along each axis, in pixels.
    pub noise_px: f64,
}

/// Returns the residuals of the features with the description and with `found`, in pixels.
///
/// # Errors
/// An invalid setting.
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
