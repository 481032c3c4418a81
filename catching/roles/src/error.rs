//! Errors of the stack's processes.

use std::path::PathBuf;

/// Error that ends a process of the stack. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum RoleError {
    /// Error of the channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// Invalid settings of the pose estimator.
    #[error(transparent)]
    Pose(#[from] tactnet_catching::pose::PoseError),
    /// Invalid settings of the tracker.
    #[error(transparent)]
    Track(#[from] tactnet_catching::track::TrackError),
    /// Invalid section `[components.catching]` of the table.
    #[error("[components.catching]: {0}")]
    Settings(#[from] toml::de::Error),
    /// Invalid section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// Invalid description of the robot, or invalid calibration.
    #[error("{path}: {reason}", path = .path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// Reason in plain words.
        reason: String,
    },
    /// The slip watch needs a calibration, but the settings name none.
    #[error(
        "[components.catching]: expected `calibration = \"FILE\"`, which the slip watch checks, found none"
    )]
    NoCalibration,
    /// Invalid settings of the slip watch.
    #[error("[components.catching]: {0}")]
    Slip(#[from] tactnet_catching::calibrate::CalibrationError),
    /// Unknown name of a role.
    #[error("unknown role `{name}`, expected one of {known}")]
    NoRole {
        /// Requested name.
        name: String,
        /// Names of all roles.
        known: String,
    },
}

impl RoleError {
    /// Returns true if the caller can correct the error (exit code 2), false for a failure at run time (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Channel(error) => error.is_usage(),
            Self::Skin(error) => error.is_usage(),
            Self::Pose(_) | Self::Track(_) => false,
            Self::Settings(_)
            | Self::File { .. }
            | Self::NoCalibration
            | Self::Slip(_)
            | Self::NoRole { .. } => true,
        }
    }
}
