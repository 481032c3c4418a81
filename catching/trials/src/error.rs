//! Errors of trials.

use tactnet_catching::calibrate::CalibrationError;
use tactnet_catching::map::MapError;
use tactnet_catching::pose::PoseError;
use tactnet_catching::throw::NoThrow;
use tactnet_catching::track::TrackError;
use tactnet_catching_packets::checks::SettingError;
use tactnet_catching_world::WorldError;

/// Error of a trial.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TrialError {
    /// Invalid settings of the world.
    #[error(transparent)]
    World(#[from] WorldError),
    /// The map cannot be built.
    #[error(transparent)]
    Map(#[from] MapError),
    /// The head pose cannot be estimated.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Balls cannot be tracked.
    #[error(transparent)]
    Track(#[from] TrackError),
    /// No throw is possible.
    #[error(transparent)]
    Throw(#[from] NoThrow),
    /// The robot braked, or its hand did not open.
    #[error("the ball was not thrown: {reason}")]
    NotThrown {
        /// Reason in plain words.
        reason: String,
    },
    /// The robot did not return to its waiting pose.
    #[error("the robot did not return to its waiting pose")]
    NotBack,
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The calibration failed; the previous one stays valid.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Too few configurations show the robot's markers to its cameras.
    #[error(
        "expected {expected} configurations with a visible marker and a collision-free path, found {found}"
    )]
    NoConfigurations {
        /// Number of requested configurations.
        expected: usize,
        /// Number of configurations found.
        found: usize,
    },
}
