//! Errors of the world.

use tactnet_catching_packets::checks::SettingError;
pub(crate) use tactnet_catching_packets::checks::{
    from_to, not_negative, positive, probability, rising,
};

/// Error of the settings or the use of a world.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A joint starts out of range.
    #[error("joint {joint} starts at {found}, expected {low} to {high}")]
    Start {
        /// Number of the joint.
        joint: usize,
        /// Start position, in rad or m.
        found: f64,
        /// Minimum position, in rad or m.
        low: f64,
        /// Maximum position, in rad or m.
        high: f64,
    },
    /// No throw reaches a corner of the target box, not even the fastest from the minimum distance.
    #[error(
        "`thrower.box`: its corner {corner:?} is out of reach, even at {speed} m/s from {distance} m"
    )]
    OutOfThrow {
        /// Corner, in m.
        corner: [f64; 3],
        /// Maximum of `thrower.speed`, in m/s.
        speed: f64,
        /// Minimum of `thrower.distance`, in m.
        distance: f64,
    },
    /// A hand cannot take another ball.
    #[error("hand {arm} holds a ball, expected nothing")]
    Hand {
        /// Arm, 0 for left and 1 for right.
        arm: usize,
    },
    /// Unknown arm.
    #[error("there is no arm {arm}, expected 0 (left) or 1 (right)")]
    Arm {
        /// Number of the arm.
        arm: usize,
    },
    /// The torso springs are too weak for the weight of the robot.
    #[error("`torso.frequencies`: springs of {frequencies:?} Hz do not carry the robot")]
    Collapses {
        /// Frequencies in the settings, in Hz.
        frequencies: [f64; 3],
    },
}
