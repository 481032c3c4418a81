//! Individual values behind the statistics of a calibration.

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
