//! Why a calibration fails. The last good one stays as it is.

use super::unknowns::ARM_NAMES;

/// Why there is no calibration.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// A value that is no number.
    #[error("{record} {number}: expected numbers, found {found}")]
    NotFinite {
        /// Kind of the record.
        record: &'static str,
        /// Its place among those of its kind, from 0.
        number: usize,
        /// The value.
        found: f64,
    },
    /// An arm that is none.
    #[error("picture {number}: expected arm 0 or 1, found {found}")]
    Arm {
        /// Its place among the pictures.
        number: usize,
        /// The arm.
        found: usize,
    },
    /// A marker that one of the cameras never saw.
    #[error("the {camera} camera never saw the marker of the {} arm: expected at least {expected} features", ARM_NAMES[*arm])]
    NeverSeen {
        /// 0 left, 1 right.
        arm: usize,
        /// Which camera.
        camera: &'static str,
        /// Least number of features.
        expected: usize,
    },
    /// Too few configurations of an arm.
    #[error("expected at least {expected} configurations of the {} arm, found {found}", ARM_NAMES[*arm])]
    TooFew {
        /// 0 left, 1 right.
        arm: usize,
        /// At least.
        expected: usize,
        /// Those with features in both cameras.
        found: usize,
    },
    /// Left and right picture are exchanged.
    #[error(
        "the cameras are exchanged: expected markers farther right in the left picture than in the right one, found them {found:.0} pixels farther left"
    )]
    Exchanged {
        /// Median, pixels.
        found: f64,
    },
    /// A setting that makes no sense.
    #[error("`{setting}`: expected a number greater than 0, found {found}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// What it is.
        found: f64,
    },
    /// The solver did not come to an end.
    #[error("no minimum after {iterations} iterations")]
    NoMinimum {
        /// Iterations.
        iterations: usize,
    },
    /// The solution does not explain the session.
    #[error(
        "the best fit leaves {found:.2} times the noise of features, expected at most {expected:.2}: something is not as the model says"
    )]
    Fit {
        /// Median of the residuals' lengths over that of the noise alone.
        found: f64,
        /// At most.
        expected: f64,
    },
    /// An unknown that ended far from everything plausible.
    #[error(
        "{unknown}: found {found:.4}, {sigmas:.0} standard deviations from what is plausible, expected at most {expected:.0}"
    )]
    Implausible {
        /// Its name.
        unknown: String,
        /// What was found.
        found: f64,
        /// How far that is.
        sigmas: f64,
        /// At most.
        expected: f64,
    },
}
