//! Settings and errors of the tracker.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::checks::{self, SettingError, all, finite, from_to};

use super::mht::{MAX_HYPOTHESES, MAX_SCANS};
use crate::flight::DRAG;
use crate::pose::positive;

/// Mean number of false circles per picture, measured in pictures of a room with people and round objects.
pub const CLUTTER_OF_PICTURES: f64 = 24.0;

tactnet_catching_packets::settings! {
    /// Settings of a [`BallTracker`](super::BallTracker).
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct TrackConfig in "": TrackError {
        /// Standard deviation of a circle's centre per axis, in pixels.
        pub centre_noise: f64 = 0.3 => positive,
        /// Standard deviation of a circle's radius, in pixels.
        pub radius_noise: f64 = 0.4 => positive,
        /// Fraction of a ball's motion during the exposure by which the circle may be displaced: 1 if it may show any
        /// moment of the exposure, 0 if it always shows the middle.
        pub blur: f64 = 0.1 => checks::probability,
        /// White acceleration noise, in m/s^2 per square root of Hz. After `t` seconds, the velocity's standard
        /// deviation is this value times the root of `t`. An acceleration of 0.1 m/s^2 that is constant for 40 ms and
        /// independent between pictures corresponds to 0.02.
        pub acceleration_noise: f64 = 0.005 => positive,
        /// Mean and standard deviation of a ball's drag coefficient, in 1/m.
        pub drag: [f64; 2] = [DRAG, 0.15 * DRAG] => positive,
        /// Random walk of the drag coefficient, in 1/m per square root of a second.
        pub drag_walk: f64 = 1e-4 => positive,
        /// Standard deviation of a ball's lift vector per axis, in 1/s. Up to five rotations per second about any axis
        /// correspond to 0.0075.
        pub lift: f64 = 0.0075 => positive,
        /// Random walk of the lift vector, in 1/s per square root of a second.
        pub lift_walk: f64 = 1e-4 => positive,
        /// Detection probability of a ball in a picture.
        pub detection: f64 = 0.95 => probability,
        /// Mean number of false circles per picture.
        pub clutter: f64 = 1.0 => positive,
        /// Minimum and maximum radius of false circles, in pixels.
        pub clutter_radius: [f64; 2] = [2.0, 150.0] => rising,
        /// Mean number of new balls per picture.
        pub births: f64 = 0.02 => positive,
        /// Probability that a ball survives from picture to picture.
        pub survival: f64 = 0.998 => probability,
        /// Maximum squared Mahalanobis distance of a ball's circle: 99.9 % quantile of chi-square with 3 degrees of
        /// freedom.
        pub gate: f64 = 16.266 => positive,
        /// Number of best assignments per hypothesis and picture.
        pub assignments: usize = 20 => up_to(1000),
        /// Number of pictures after which the ancestor of the best hypothesis is accepted (N-scan pruning).
        pub scans: usize = 3 => up_to(MAX_SCANS),
        /// Maximum number of hypotheses.
        pub hypotheses: usize = MAX_HYPOTHESES => up_to(MAX_HYPOTHESES),
        /// Minimum weight of a hypothesis relative to the best one.
        pub least_weight: f64 = 1e-6 => probability,
        /// Existence probability from which a ball is reported.
        pub report: f64 = 0.5 => probability,
        /// Maximum time between two pictures, in s.
        pub longest_gap: f64 = 0.25 => positive,
        /// Maximum time for which a ball is tracked outside both cameras' views, in s.
        pub longest_unseen: f64 = 0.3 => positive,
        /// Prior of throws.
        pub throws: ThrowPrior = ThrowPrior::default() => |_, throws: &ThrowPrior| throws.check_settings(),
    }
}

tactnet_catching_packets::settings! {
    /// Prior of a ball's motion when it is first seen.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ThrowPrior in "throws.": TrackError {
        /// Minimum and maximum speed, in m/s.
        pub speed: [f64; 2] = [3.0, 10.0] => rising,
        /// Mean and standard deviation of the horizontal speed towards the robot, in m/s.
        pub towards: [f64; 2] = [6.0, 1.5] => positive,
        /// Mean target of throws relative to the head, along the inertial axes, in m.
        pub aim: [f64; 3] = [0.4, 0.0, -0.3] => finite,
        /// Standard deviation of the target, sideways and upwards, in m.
        pub spread: [f64; 2] = [0.7, 0.5] => positive,
        /// Maximum height of a ball, in m.
        pub highest: f64 = 4.0 => positive,
        /// Minimum height at which a ball may appear, in m.
        pub lowest: f64 = 0.3 => positive,
        /// Minimum and maximum distance at which a ball may appear, in m.
        pub distance: [f64; 2] = [0.7, 8.0] => rising,
        /// Volume in which balls appear, in m^3.
        pub volume: f64 = 60.0 => positive,
    }
}

impl TrackConfig {
    /// Returns the variances of u, v and r, in px^2.
    pub(super) fn variances(&self) -> Vector3<f64> {
        let centre = self.centre_noise * self.centre_noise;
        Vector3::new(centre, centre, self.radius_noise * self.radius_noise)
    }
}

fn probability(setting: &'static str, value: &f64) -> Result<(), SettingError> {
    let expected = "a probability between 0 and 1";
    all(setting, value, expected, |x| x > 0.0 && x < 1.0)
}

fn rising(setting: &'static str, [least, greatest]: &[f64; 2]) -> Result<(), SettingError> {
    let expected = "[lowest, highest], both greater than 0";
    all(setting, least, expected, |least| {
        least > 0.0 && least < *greatest && *greatest < 1e4
    })
}

fn up_to(most: usize) -> impl Fn(&'static str, &usize) -> Result<(), SettingError> {
    let expected = "a count from 1 to the documented maximum";
    from_to::<usize>([1.0, most as f64], expected)
}

/// Error of the tracker. Unless stated otherwise, the input is ignored and nothing changes.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// The pictures are not a pair.
    #[error(
        "expected the left and the right circles of one exposure, found pictures {left} and {right}"
    )]
    Pair {
        /// Number of the left picture.
        left: u64,
        /// Number of the right picture.
        right: u64,
    },
    /// The packet states more circles than it can hold.
    #[error("picture {frame}: expected up to {most} circles, found {found}", most = tactnet_catching_packets::packets::MAX_CIRCLES)]
    Count {
        /// Picture number.
        frame: u64,
        /// Stated number of circles.
        found: u32,
    },
    /// A circle is invalid: not finite, without radius, or far outside of the picture.
    #[error("picture {frame}: expected circles in pixels, found ({u}, {v}, {r})")]
    Circle {
        /// Picture number.
        frame: u64,
        /// Horizontal centre, in pixels.
        u: f64,
        /// Vertical centre, in pixels.
        v: f64,
        /// Radius, in pixels.
        r: f64,
    },
    /// The head pose is invalid or has a different time.
    #[error(
        "expected a valid head pose at {exposure_ns} ns, found an invalid one or one of {found_ns} ns"
    )]
    Head {
        /// Exposure time of the pictures, in ns.
        exposure_ns: u64,
        /// Time of the pose, in ns.
        found_ns: u64,
    },
    /// The pictures are older than the last ones and are ignored.
    #[error("expected pictures after {last_ns} ns, found pictures of {found_ns} ns")]
    Late {
        /// Exposure time of the last pictures, in ns.
        last_ns: u64,
        /// Exposure time of these pictures, in ns.
        found_ns: u64,
    },
    /// Too much time has passed since the last pictures, or the clock was set back by more than one second. All tracks
    /// end, and the next pictures start anew.
    #[error("no pictures between {last_ns} ns and {found_ns} ns; all tracks end")]
    Gap {
        /// Exposure time of the last pictures, in ns.
        last_ns: u64,
        /// Exposure time of these pictures, in ns.
        found_ns: u64,
    },
}
