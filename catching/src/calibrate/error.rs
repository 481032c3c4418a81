//! Errors of a calibration. The previous calibration stays valid after an error.

use tactnet_catching_packets::checks::SettingError;

use super::unknowns::ARM_NAMES;

/// Reason for a failed calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A recorded value is not finite.
    #[error("{record} {number}: expected numbers, found {found}")]
    NotFinite {
        /// Kind of the record.
        record: &'static str,
        /// Index among the records of this kind, from 0.
        number: usize,
        /// Recorded value.
        found: f64,
    },
    /// An arm index is out of range.
    #[error("picture {number}: expected arm 0 or 1, found {found}")]
    Arm {
        /// Index of the picture.
        number: usize,
        /// Recorded arm index.
        found: usize,
    },
    /// A camera saw a marker too rarely.
    #[error("the {camera} camera never saw the marker of the {} arm: expected at least {expected} features", ARM_NAMES[*arm])]
    NeverSeen {
        /// Arm: 0 left, 1 right.
        arm: usize,
        /// Name of the camera.
        camera: &'static str,
        /// Minimum number of features.
        expected: usize,
    },
    /// An arm has too few configurations.
    #[error("expected at least {expected} configurations of the {} arm, found {found}", ARM_NAMES[*arm])]
    TooFew {
        /// Arm: 0 left, 1 right.
        arm: usize,
        /// Minimum number of configurations.
        expected: usize,
        /// Number of configurations with features in both cameras.
        found: usize,
    },
    /// Left and right pictures are swapped.
    #[error(
        "the cameras are exchanged: expected a positive disparity of the markers, found -{found:.0} pixels"
    )]
    Exchanged {
        /// Median disparity with the wrong sign, in pixels.
        found: f64,
    },
    /// A setting is invalid.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The solver did not converge.
    #[error("no convergence after {iterations} iterations")]
    NoMinimum {
        /// Number of iterations.
        iterations: usize,
    },
    /// The model does not fit the session.
    #[error(
        "expected a median residual of at most {expected:.2} times the feature noise, found {found:.2}: the model does not fit the session"
    )]
    Fit {
        /// Median residual norm, relative to the noise.
        found: f64,
        /// Maximum of this ratio.
        expected: f64,
    },
    /// An estimated parameter is implausible.
    #[error(
        "{unknown}: found {found:.4}, which is {sigmas:.0} standard deviations from its prior, expected at most {expected:.0}"
    )]
    Implausible {
        /// Name of the unknown.
        unknown: String,
        /// Estimated value.
        found: f64,
        /// Deviation from the prior, in standard deviations.
        sigmas: f64,
        /// Maximum deviation, in standard deviations.
        expected: f64,
    },
}
