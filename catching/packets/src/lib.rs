//! What the catching stack and the world that judges it share: the [description of the robot](RobotDescription) and plain-data
//! [packets]. Neither knows the other.
//!
//! Units are SI, angles radians, times nanoseconds of one clock. The inertial frame has its origin on the floor below the platform's
//! starting place, x forward (where balls come from), y left, z up. The chest's frame is turned about z only: a passive joint keeps the
//! chest upright.

mod description;
pub mod packets;

pub use description::{
    Arm, Cameras, DescriptionError, Imu, Joint, Link, Neck, Platform, RobotDescription, Torso,
};

/// Joints of platform, torso, neck and arms, in the order of [`joint`].
pub const JOINTS: usize = 20;
/// Joints of an arm.
pub const ARM_JOINTS: usize = 7;
/// Joints that throw: the turn about the vertical, then an arm's.
pub const THROW_JOINTS: usize = ARM_JOINTS + 1;
/// Arms.
pub const ARMS: usize = 2;

/// Where joints stand in packets.
pub mod joint {
    use std::ops::Range;

    /// The platform's sideways axis, metres along y.
    pub const PLATFORM: usize = 0;
    /// Torso: about the vertical, lower pitch, upper pitch.
    pub const TORSO: Range<usize> = 1..4;
    /// Neck: pan, tilt.
    pub const NECK: Range<usize> = 4..6;
    /// Left arm, from the shoulder.
    pub const LEFT_ARM: Range<usize> = 6..13;
    /// Right arm, from the shoulder.
    pub const RIGHT_ARM: Range<usize> = 13..20;
    /// Both arms: left, right.
    pub const ARM: [Range<usize>; super::ARMS] = [LEFT_ARM, RIGHT_ARM];
}
