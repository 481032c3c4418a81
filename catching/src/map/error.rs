//! What can be wrong with a map or with a picture for it.

/// Why there is no map, or a picture does not go into it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MapError {
    /// A setting out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
    /// A picture of another size.
    #[error("the depth picture has {found} pixels, expected {width} x {height}")]
    Size {
        /// Pixels that it has.
        found: usize,
        /// Pixels across that it should have.
        width: usize,
        /// Pixels down.
        height: usize,
    },
    /// A depth that is none.
    #[error(
        "pixel {pixel} of the depth picture is {found} m, expected a number that is 0 (nothing measured) or greater"
    )]
    Depth {
        /// Counted row by row from the top left.
        pixel: usize,
        /// What it says.
        found: f32,
    },
    /// Nothing was measured anywhere.
    #[error("the depth picture has no measured pixel: is the camera covered?")]
    Blind,
    /// A head that is nowhere.
    #[error("the head's pose has numbers that are not finite")]
    Pose,
}
