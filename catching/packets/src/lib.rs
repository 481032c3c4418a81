//! Types that the catching stack and the simulated world share: the [robot description](RobotDescription) and
//! plain-data [packets]. The stack and the world do not depend on each other.
//!
//! All quantities are in SI units, angles in radians and times in nanoseconds of one common clock. The origin of the
//! inertial frame is on the floor below the platform's start position. Its x axis points forward (towards the thrower),
//! y left and z up. The chest frame is rotated about z only, because a passive joint keeps the chest upright.

pub mod checks;
mod description;
pub mod packets;
mod settings;

pub use description::{
    Arm, Cameras, DescriptionError, Imu, Joint, Link, Neck, Platform, RobotDescription, Torso,
};
pub use settings::Numbers;

/// Number of joints of platform, torso, neck and arms, in the order of [`joint`].
pub const JOINTS: usize = 20;
/// Number of joints per arm.
pub const ARM_JOINTS: usize = 7;
/// Number of joints that take part in a throw: the torso's vertical joint, then those of one arm.
pub const THROW_JOINTS: usize = ARM_JOINTS + 1;
/// Number of arms.
pub const ARMS: usize = 2;

/// Indices of joints in packets.
pub mod joint {
    use std::ops::Range;

    /// Index of the platform's sideways axis, in metres along y.
    pub const PLATFORM: usize = 0;
    /// Indices of the torso joints: vertical axis, lower pitch, upper pitch.
    pub const TORSO: Range<usize> = 1..4;
    /// Indices of the neck joints: pan, tilt.
    pub const NECK: Range<usize> = 4..6;
    /// Indices of the left arm's joints, from the shoulder.
    pub const LEFT_ARM: Range<usize> = 6..13;
    /// Indices of the right arm's joints, from the shoulder.
    pub const RIGHT_ARM: Range<usize> = 13..20;
    /// Indices of both arms' joints: left, right.
    pub const ARM: [Range<usize>; super::ARMS] = [LEFT_ARM, RIGHT_ARM];

    /// Returns the values of an arm's joints.
    pub fn of_arm(all: &[f64; super::JOINTS], arm: usize) -> [f64; super::ARM_JOINTS] {
        std::array::from_fn(|i| all[ARM[arm].start + i])
    }
}
