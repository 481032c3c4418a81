//! Settings and errors of the pose estimator.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::Numbers;
use tactnet_catching_packets::checks::{SettingError, all};

tactnet_catching_packets::settings! {
    /// Settings of a [`PoseEstimator`](super::PoseEstimator). Standard deviations are per axis.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct PoseConfig in "": PoseError {
        /// White noise of an accelerometer sample, in m/s^2.
        pub accelerometer_noise: f64 = 0.02 => positive,
        /// White noise of a gyroscope sample, in rad/s.
        pub gyroscope_noise: f64 = 0.002 => positive,
        /// Initial standard deviation of the accelerometer bias, including scale errors under gravity, in m/s^2.
        pub accelerometer_bias: f64 = 0.1 => positive,
        /// Initial standard deviation of the gyroscope bias, in rad/s.
        pub gyroscope_bias: f64 = 0.01 => positive,
        /// Random walk of the accelerometer bias, in m/s^2 per square root of a second.
        pub accelerometer_walk: f64 = 1e-3 => positive,
        /// Random walk of the gyroscope bias, in rad/s per square root of a second.
        pub gyroscope_walk: f64 = 1e-4 => positive,
        /// Standard deviation of the kinematic position at rest, in m.
        pub rest_position: f64 = 0.002 => positive,
        /// Standard deviation of the kinematic attitude at rest, in rad.
        pub rest_attitude: f64 = 0.2f64.to_radians() => positive,
        /// Standard deviation of the velocity at rest, in m/s.
        pub rest_velocity: f64 = 0.002 => positive,
        /// Correlation time of kinematic errors at rest, in s.
        pub rest_correlation: f64 = 10.0 => positive,
        /// Maximum time between two samples, in s.
        pub longest_gap: f64 = 0.05 => positive,
    }
}

/// Returns an error unless all numbers of a setting are between 0 and 1000.
pub(crate) fn positive(setting: &'static str, value: &impl Numbers) -> Result<(), SettingError> {
    let expected = "a number between 0 and 1000";
    all(setting, value, expected, |x| x > 0.0 && x < 1e3)
}

/// Error of a pose estimator. Invalid input does not change the estimate.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PoseError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
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
}
