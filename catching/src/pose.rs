//! Head pose estimation from the IMU (thesis, section 3.3.2) with an error-state Kalman filter of 15 states.
//!
//! ```text
//! position and velocity of the IMU, rotation, accelerometer bias, gyroscope bias
//! ```
//!
//! At rest, kinematics provide the head pose, the velocity is zero and the gyroscope measures its own bias. Gravity
//! couples the accelerometer bias to the attitude. During a catch the filter only integrates. The kinematics of torso
//! and platform are not used then, because springs, vibrations and wheel slip make them inaccurate. They can still
//! bound the drift weakly: [`PoseEstimator::correct`].
//!
//! Errors are expressed in the inertial frame: the true rotation is `exp(theta)` times the estimated one. Kinematic
//! errors stay constant for seconds. The measurements of one correlation time therefore count together as one
//! measurement with the given standard deviation.

mod config;
mod error_state;
mod estimator;
mod ring;
#[cfg(test)]
pub(crate) mod shaking;

pub use config::{PoseConfig, PoseError};
pub use estimator::PoseEstimator;
pub use ring::PoseRing;
