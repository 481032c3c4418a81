//! Head pose estimation from the IMU (thesis, section 3.3.2) with an error-state Kalman filter of 15 states.
//!
//! ```text
//! position and velocity of the IMU, rotation, accelerometer bias, gyroscope bias
//! ```
//!
//! At rest, kinematics provide the head pose, the velocity is zero and the gyroscope measures its own bias. Gravity
//! couples the accelerometer bias to the attitude. During a catch the filter only integrates. The kinematics of torso
//! and platform are not used then, because springs, vibrations and wheel slip make them inaccurate.
//!
//! Errors are expressed in the inertial frame: the true rotation is `exp(theta)` times the estimated one. Kinematic
//! errors stay constant for seconds. The measurements of one correlation time therefore count together as one
//! measurement with the given standard deviation.

mod config;
mod error_state;
mod estimator;
mod head_estimator;
mod ring;
#[cfg(test)]
pub(crate) mod shaking;

pub(crate) use config::positive;
pub use config::{PoseConfig, PoseError};
pub use estimator::PoseEstimator;
pub use head_estimator::{HeadEstimator, HeadInputs, TORSO_RESTS};
pub use ring::{POSES, PoseRing};

/// Gravity as measured by the IMU, in m/s^2.
pub(crate) const GRAVITY: f64 = 9.81;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use tactnet_catching_packets::packets::HeadPose;

/// Returns the transformation from the head frame to the inertial frame.
pub fn isometry(pose: &HeadPose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.quaternion;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(pose.position), rotation)
}
