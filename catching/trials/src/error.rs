//! Errors of trials.

use tactnet_catching::calibrate::CalibrationError;
use tactnet_catching::map::MapError;
use tactnet_catching::pose::PoseError;
use tactnet_catching::throw::NoThrow;
use tactnet_catching::track::TrackError;
use tactnet_catching_world::WorldError;

/// Why a trial cannot be run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrialError {
    /// Settings of the world make no sense.
    #[error(transparent)]
    World(#[from] WorldError),
    /// There is no map.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The head's pose cannot be estimated.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Balls cannot be tracked.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// Nothing can be thrown.
    #[error(transparent)]
    Throw(#[from] NoThrow),
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
    /// There is no calibration; the last one stays.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A robot whose markers its cameras hardly ever see.
    #[error(
        "expected {expected} configurations in which a marker is seen and the way is free, found {found}"
    )]
    NoConfigurations {
        /// So many were asked for.
        expected: usize,
        /// So many were found.
        found: usize,
    },
}
