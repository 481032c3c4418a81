//! Settings of the pose estimator, and what can be wrong with what it is given.

use serde::{Deserialize, Serialize};

/// Settings of a [`PoseEstimator`](super::PoseEstimator); standard deviations along one axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseConfig {
    /// White noise of a sample of the accelerometer, m/s^2.
    pub accelerometer_noise: f64,
    /// White noise of a sample of the gyroscope, rad/s.
    pub gyroscope_noise: f64,
    /// Bias of the accelerometer at the start, errors of scale under gravity included, m/s^2.
    pub accelerometer_bias: f64,
    /// Bias of the gyroscope at the start, rad/s.
    pub gyroscope_bias: f64,
    /// Random walk of the accelerometer's bias, m/s^2 per square root of a second.
    pub accelerometer_walk: f64,
    /// Random walk of the gyroscope's bias, rad/s per square root of a second.
    pub gyroscope_walk: f64,
    /// Position by kinematics while the robot stands still, m.
    pub rest_position: f64,
    /// Attitude by kinematics while the robot stands still, rad.
    pub rest_attitude: f64,
    /// Velocity of a head that stands still, m/s.
    pub rest_velocity: f64,
    /// For how long kinematics are wrong by the same amount while the robot stands still, s.
    pub rest_correlation: f64,
    /// Position by kinematics in motion, m.
    pub motion_position: f64,
    /// Attitude by kinematics in motion, rad.
    pub motion_attitude: f64,
    /// For how long kinematics are wrong by the same amount in motion, s.
    pub motion_correlation: f64,
    /// Longest time between two samples that is bridged, s.
    pub longest_gap: f64,
    /// How long poses are kept, s.
    pub ring: f64,
}

impl Default for PoseConfig {
    fn default() -> Self {
        Self {
            accelerometer_noise: 0.02,
            gyroscope_noise: 0.002,
            accelerometer_bias: 0.1,
            gyroscope_bias: 0.01,
            accelerometer_walk: 1e-3,
            gyroscope_walk: 1e-4,
            rest_position: 0.002,
            rest_attitude: 0.2f64.to_radians(),
            rest_velocity: 0.002,
            rest_correlation: 10.0,
            motion_position: 0.02,
            motion_attitude: 2.0f64.to_radians(),
            motion_correlation: 0.3,
            longest_gap: 0.05,
            ring: 0.3,
        }
    }
}

impl PoseConfig {
    pub(super) fn check(&self) -> Result<(), PoseError> {
        let settings = [
            ("accelerometer_noise", self.accelerometer_noise),
            ("gyroscope_noise", self.gyroscope_noise),
            ("accelerometer_bias", self.accelerometer_bias),
            ("gyroscope_bias", self.gyroscope_bias),
            ("accelerometer_walk", self.accelerometer_walk),
            ("gyroscope_walk", self.gyroscope_walk),
            ("rest_position", self.rest_position),
            ("rest_attitude", self.rest_attitude),
            ("rest_velocity", self.rest_velocity),
            ("rest_correlation", self.rest_correlation),
            ("motion_position", self.motion_position),
            ("motion_attitude", self.motion_attitude),
            ("motion_correlation", self.motion_correlation),
            ("longest_gap", self.longest_gap),
            ("ring", self.ring),
        ];
        match settings
            .into_iter()
            .find(|(_, value)| !(value.is_finite() && *value > 0.0 && *value < 1e3))
        {
            Some((setting, found)) => Err(PoseError::Setting { setting, found }),
            None => Ok(()),
        }
    }
}

/// What is wrong with what a pose estimator was given. None of it changes an estimate.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A setting that makes no sense.
    #[error("`{setting}`: expected a number between 0 and 1000, found {found}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// What it is.
        found: f64,
    },
    /// A value that is no number or beyond what such a sensor can measure; the sample is ignored.
    #[error("sample {number}: expected numbers within the sensor's range, found {found}")]
    Value {
        /// Number of the sample.
        number: u64,
        /// The first one that is wrong.
        found: f64,
    },
    /// A pose by kinematics that is none; it is ignored, with its sample.
    #[error("expected a pose by kinematics, found one that is not finite")]
    Kinematics,
    /// A sample from before the last one; it is ignored, or, from more than a second before, taken as a clock that was set: lost.
    #[error("expected a sample after {last_ns} ns, found one of {found_ns} ns")]
    Backwards {
        /// Of the last sample.
        last_ns: u64,
        /// Of this one.
        found_ns: u64,
    },
    /// Too long after the last sample: how the head moved meanwhile is unknown. The pose is lost, the biases are kept.
    #[error(
        "no sample between {last_ns} ns and {found_ns} ns; the pose is lost until the robot stands still"
    )]
    Gap {
        /// Of the last sample.
        last_ns: u64,
        /// Of this one.
        found_ns: u64,
    },
    /// No pose yet, or none since it was lost: the robot has to stand still first.
    #[error("the pose is unknown until the robot stands still")]
    Unknown,
    /// Asked for a moment that no pose is kept of.
    #[error("expected a time from {first_ns} ns to {last_ns} ns, found {found_ns} ns")]
    NotKept {
        /// Earliest one kept.
        first_ns: u64,
        /// Latest one kept.
        last_ns: u64,
        /// What was asked for.
        found_ns: u64,
    },
}
