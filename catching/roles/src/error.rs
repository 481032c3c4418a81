//! Errors of the stack's processes.

use std::path::PathBuf;

/// Why a process of the stack ends; each is one line for people.
#[derive(Debug, thiserror::Error)]
pub enum RoleError {
    /// The channels.
    #[error(transparent)]
    Channel(#[from] tactnet_channel::ChannelError),
    /// Settings of the pose estimator.
    #[error(transparent)]
    Pose(#[from] tactnet_catching::pose::PoseError),
    /// Settings of the tracker.
    #[error(transparent)]
    Track(#[from] tactnet_catching::track::TrackError),
    /// The table's section.
    #[error("[components.catching]: {0}")]
    Settings(#[from] toml::de::Error),
    /// The table's section of the classifier.
    #[error(transparent)]
    Skin(#[from] tactnet_skin::SkinError),
    /// The description of the robot.
    #[error("{path}: {reason}", path = .path.display())]
    Robot {
        /// Its file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// What the robot's description lacks.
    #[error("{path}: {reason}", path = .path.display())]
    Calibration {
        /// Its file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Nothing that could be watched.
    #[error(
        "[components.catching]: expected `calibration = \"FILE\"`: without one there is nothing to watch"
    )]
    NoCalibration,
    /// Settings of the watch.
    #[error("[components.catching]: {0}")]
    Slip(#[from] tactnet_catching::calibrate::CalibrationError),
    /// A name of no role.
    #[error("no role `{name}`; there are {known}")]
    NoRole {
        /// The name asked for.
        name: String,
        /// Those that there are.
        known: String,
    },
}

impl RoleError {
    /// Returns true where the call must be corrected (exit code 2), false where something broke (exit code 1).
    pub fn is_usage(&self) -> bool {
        match self {
            Self::Channel(error) => error.is_usage(),
            Self::Skin(error) => error.is_usage(),
            Self::Pose(_) | Self::Track(_) => false,
            Self::Settings(_)
            | Self::Robot { .. }
            | Self::Calibration { .. }
            | Self::NoCalibration
            | Self::Slip(_)
            | Self::NoRole { .. } => true,
        }
    }
}
