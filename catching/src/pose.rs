//! Where the head is, from its inertial unit (thesis, section 3.3.2): an error-state Kalman filter of 15 states.
//!
//! ```text
//! position, velocity of the inertial unit, rotation, bias of the accelerometer, bias of the gyroscope
//! ```
//!
//! While the robot stands still, kinematics say where the head is, its velocity is zero and the gyroscope measures its own bias; gravity,
//! felt while nothing moves, ties the accelerometer's bias to the attitude. During a catch the filter only integrates: no kinematics of
//! torso and platform come in, since springs, vibrations and slipping wheels make them wrong just then. What kinematics say can still
//! bound the drift, weakly: [`PoseEstimator::correct`].
//!
//! Errors are those of the inertial frame: the true rotation is `exp(theta)` times the estimated one. Kinematics are wrong by the same
//! amount for seconds, so a measurement by kinematics counts as one of its standard deviation every correlation time, not every sample.

mod config;
mod error_state;
mod estimator;
mod ring;
#[cfg(test)]
pub(crate) mod shaking;

pub use config::{PoseConfig, PoseError};
pub use estimator::PoseEstimator;
pub use ring::PoseRing;
