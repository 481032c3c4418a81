//! Errors of maps and depth pictures.

use tactnet_catching_packets::checks::SettingError;

/// Reason why a map or a depth picture is invalid.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
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
