//! Settings and errors of the pose estimator.

use serde::{Deserialize, Serialize};

/// Settings of a [`PoseEstimator`](super::PoseEstimator). Standard deviations are per axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseConfig {
    /// White noise of an accelerometer sample, in m/s^2.
    pub accelerometer_noise: f64,
    /// White noise of a gyroscope sample, in rad/s.
    pub gyroscope_noise: f64,
    /// Initial standard deviation of the accelerometer bias, including scale errors under gravity, in m/s^2.
    pub accelerometer_bias: f64,
    /// Initial standard deviation of the gyroscope bias, in rad/s.
    pub gyroscope_bias: f64,
    /// Random walk of the accelerometer bias, in m/s^2 per square root of a second.
    pub accelerometer_walk: f64,
    /// Random walk of the gyroscope bias, in rad/s per square root of a second.
    pub gyroscope_walk: f64,
    /// Standard deviation of the kinematic position at rest, in m.
    pub rest_position: f64,
    /// Standard deviation of the kinematic attitude at rest, in rad.
    pub rest_attitude: f64,
    /// Standard deviation of the velocity at rest, in m/s.
    pub rest_velocity: f64,
    /// Correlation time of kinematic errors at rest, in s.
    pub rest_correlation: f64,
    /// Maximum time between two samples, in s.
    pub longest_gap: f64,
    /// Time for which poses are stored, in s.
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

/// Error of a pose estimator. Invalid input does not change the estimate.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A setting is out of range.
    #[error("`{setting}`: expected a number between 0 and 1000, found {found}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Value of the setting.
        found: f64,
    },
    /// A value is not a number or exceeds the sensor's range. The sample is ignored.
    #[error("sample {number}: expected values within the sensor's range, found {found}")]
    Value {
        /// Sample number.
        number: u64,
        /// First invalid value.
        found: f64,
    },
    /// The kinematic pose is not finite. It is ignored together with its sample.
    #[error("expected a finite kinematic pose")]
    Kinematics,
    /// The sample is older than the last one and is ignored. A difference of more than one second means that the clock
    /// was set; the pose is then lost.
    #[error("expected a sample after {last_ns} ns, found one of {found_ns} ns")]
    Backwards {
        /// Time of the last sample, in ns.
        last_ns: u64,
        /// Time of this sample, in ns.
        found_ns: u64,
    },
    /// Too much time has passed since the last sample. The pose is lost, the biases are kept.
    #[error(
        "no sample between {last_ns} ns and {found_ns} ns; the pose is unknown until the robot is at rest"
    )]
    Gap {
        /// Time of the last sample, in ns.
        last_ns: u64,
        /// Time of this sample, in ns.
        found_ns: u64,
    },
    /// The pose is unknown or lost. The robot must first be at rest.
    #[error("the pose is unknown until the robot is at rest")]
    Unknown,
    /// No pose is stored for this time.
    #[error("expected a time from {first_ns} ns to {last_ns} ns, found {found_ns} ns")]
    NotKept {
        /// Earliest stored time, in ns.
        first_ns: u64,
        /// Latest stored time, in ns.
        last_ns: u64,
        /// Requested time, in ns.
        found_ns: u64,
    },
}
