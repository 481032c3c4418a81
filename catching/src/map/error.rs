//! Errors of maps and depth pictures.

use std::fmt::Debug;

use tactnet_catching_packets::Numbers;

/// Reason why a map or a depth picture is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapError {
    /// A setting is out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Expected value.
        expected: &'static str,
        /// Actual value.
        found: String,
    },
    /// The picture has the wrong size.
    #[error("the depth picture has {found} pixels, expected {width} x {height}")]
    Size {
        /// Actual number of pixels.
        found: usize,
        /// Expected width, in pixels.
        width: usize,
        /// Expected height, in pixels.
        height: usize,
    },
    /// A depth is invalid.
    #[error("pixel {pixel} of the depth picture is {found} m, expected 0 (not measured) or more")]
    Depth {
        /// Index of the pixel, row by row from the top left.
        pixel: usize,
        /// Actual value, in m.
        found: f32,
    },
    /// The picture has no measured pixel.
    #[error("the depth picture has no measured pixel: check that the camera is not covered")]
    Blind,
    /// The head pose is not finite.
    #[error("the head pose has values that are not finite")]
    Pose,
}

/// Returns an error unless all numbers of a setting satisfy a condition.
pub(super) fn all<T: Numbers + Debug>(
    setting: &'static str,
    value: &T,
    expected: &'static str,
    is_valid: impl FnMut(f64) -> bool,
) -> Result<(), MapError> {
    if value.numbers().all(is_valid) {
        return Ok(());
    }
    Err(MapError::Setting {
        setting,
        expected,
        found: format!("{value:?}"),
    })
}

pub(super) fn positive<T: Numbers + Debug>(
    setting: &'static str,
    value: &T,
) -> Result<(), MapError> {
    let is_valid = |x: f64| x.is_finite() && x > 0.0;
    all(setting, value, "a number greater than 0", is_valid)
}

pub(super) fn finite(setting: &'static str, value: &[f64; 3]) -> Result<(), MapError> {
    all(setting, value, "numbers", f64::is_finite)
}
