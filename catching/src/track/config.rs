//! Settings and errors of the tracker.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::mht::{MAX_HYPOTHESES, MAX_SCANS};
use crate::flight::DRAG;

/// Mean number of false circles per picture, measured in pictures of a room with people and round objects.
pub const CLUTTER_OF_PICTURES: f64 = 24.0;

/// Settings of a [`BallTracker`](super::BallTracker).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackConfig {
    /// Standard deviation of a circle's centre per axis, in pixels.
    pub centre_noise: f64,
    /// Standard deviation of a circle's radius, in pixels.
    pub radius_noise: f64,
    /// Fraction of a ball's motion during the exposure by which the circle may be displaced: 1 if it may show any
    /// moment of the exposure, 0 if it always shows the middle.
    pub blur: f64,
    /// White acceleration noise, in m/s^2 per square root of Hz. After `t` seconds, the velocity's standard deviation
    /// is this value times the root of `t`. An acceleration of 0.1 m/s^2 that is constant for 40 ms and independent
    /// between pictures corresponds to 0.02.
    pub acceleration_noise: f64,
    /// Mean and standard deviation of a ball's drag coefficient, in 1/m.
    pub drag: [f64; 2],
    /// Random walk of the drag coefficient, in 1/m per square root of a second.
    pub drag_walk: f64,
    /// Standard deviation of a ball's lift vector per axis, in 1/s. Up to five rotations per second about any axis
    /// correspond to 0.0075.
    pub lift: f64,
    /// Random walk of the lift vector, in 1/s per square root of a second.
    pub lift_walk: f64,
    /// Detection probability of a ball in a picture.
    pub detection: f64,
    /// Mean number of false circles per picture.
    pub clutter: f64,
    /// Minimum and maximum radius of false circles, in pixels.
    pub clutter_radius: [f64; 2],
    /// Mean number of new balls per picture.
    pub births: f64,
    /// Probability that a ball survives from picture to picture.
    pub survival: f64,
    /// Maximum squared Mahalanobis distance of a ball's circle: 99.9 % quantile of chi-square with 3 degrees of
    /// freedom.
    pub gate: f64,
    /// Number of best assignments per hypothesis and picture.
    pub assignments: usize,
    /// Number of pictures after which the ancestor of the best hypothesis is accepted (N-scan pruning).
    pub scans: usize,
    /// Maximum number of hypotheses.
    pub hypotheses: usize,
    /// Minimum weight of a hypothesis relative to the best one.
    pub least_weight: f64,
    /// Existence probability from which a ball is reported.
    pub report: f64,
    /// Maximum time between two pictures, in s.
    pub longest_gap: f64,
    /// Maximum time for which a ball is tracked outside both cameras' views, in s.
    pub longest_unseen: f64,
    /// Prior of throws.
    pub throws: ThrowPrior,
}

/// Prior of a ball's motion when it is first seen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThrowPrior {
    /// Minimum and maximum speed, in m/s.
    pub speed: [f64; 2],
    /// Mean and standard deviation of the horizontal speed towards the robot, in m/s.
    pub towards: [f64; 2],
    /// Mean target of throws relative to the head, along the inertial axes, in m.
    pub aim: [f64; 3],
    /// Standard deviation of the target, sideways and upwards, in m.
    pub spread: [f64; 2],
    /// Maximum height of a ball, in m.
    pub highest: f64,
    /// Minimum height at which a ball may appear, in m.
    pub lowest: f64,
    /// Minimum and maximum distance at which a ball may appear, in m.
    pub distance: [f64; 2],
    /// Volume in which balls appear, in m^3.
    pub volume: f64,
}

impl Default for TrackConfig {
    fn default() -> Self {
        Self {
            centre_noise: 0.3,
            radius_noise: 0.4,
            blur: 0.1,
            acceleration_noise: 0.005,
            drag: [DRAG, 0.15 * DRAG],
            drag_walk: 1e-4,
            lift: 0.0075,
            lift_walk: 1e-4,
            detection: 0.95,
            clutter: 1.0,
            clutter_radius: [2.0, 150.0],
            births: 0.02,
            survival: 0.998,
            gate: 16.266,
            assignments: 20,
            scans: 3,
            hypotheses: MAX_HYPOTHESES,
            least_weight: 1e-6,
            report: 0.5,
            longest_gap: 0.25,
            longest_unseen: 0.3,
            throws: ThrowPrior::default(),
        }
    }
}

impl Default for ThrowPrior {
    fn default() -> Self {
        Self {
            speed: [3.0, 10.0],
            towards: [6.0, 1.5],
            aim: [0.4, 0.0, -0.3],
            spread: [0.7, 0.5],
            highest: 4.0,
            lowest: 0.3,
            distance: [0.7, 8.0],
            volume: 60.0,
        }
    }
}

impl TrackConfig {
    /// Returns the variances of u, v and r, in px^2.
    pub(super) fn variances(&self) -> Vector3<f64> {
        let centre = self.centre_noise * self.centre_noise;
        Vector3::new(centre, centre, self.radius_noise * self.radius_noise)
    }

    pub(super) fn check(&self) -> Result<(), TrackError> {
        self.check_positive()?;
        let throws = &self.throws;
        for (setting, value) in [
            ("detection", self.detection),
            ("survival", self.survival),
            ("least_weight", self.least_weight),
            ("report", self.report),
        ] {
            if !(value > 0.0 && value < 1.0) {
                return wrong(setting, "a probability between 0 and 1", value);
            }
        }
        if !(0.0..=1.0).contains(&self.blur) {
            return wrong("blur", "a number from 0 to 1", self.blur);
        }
        for (setting, [least, greatest]) in [
            ("clutter_radius", self.clutter_radius),
            ("throws.speed", throws.speed),
            ("throws.distance", throws.distance),
        ] {
            if !(least > 0.0 && least < greatest && greatest < 1e4) {
                return wrong(setting, "[lowest, highest], both greater than 0", least);
            }
        }
        if let Some(found) = throws.aim.into_iter().find(|x| !x.is_finite()) {
            return wrong("throws.aim", "numbers", found);
        }
        for (setting, value, most) in [
            ("assignments", self.assignments, 1000),
            ("scans", self.scans, MAX_SCANS),
            ("hypotheses", self.hypotheses, MAX_HYPOTHESES),
        ] {
            if !(1..=most).contains(&value) {
                return wrong(
                    setting,
                    "a count from 1 to the documented maximum",
                    value as f64,
                );
            }
        }
        Ok(())
    }

    fn check_positive(&self) -> Result<(), TrackError> {
        let throws = &self.throws;
        for (setting, value) in [
            ("centre_noise", self.centre_noise),
            ("radius_noise", self.radius_noise),
            ("acceleration_noise", self.acceleration_noise),
            ("drag", self.drag[0]),
            ("drag", self.drag[1]),
            ("drag_walk", self.drag_walk),
            ("lift", self.lift),
            ("lift_walk", self.lift_walk),
            ("clutter", self.clutter),
            ("births", self.births),
            ("gate", self.gate),
            ("longest_gap", self.longest_gap),
            ("longest_unseen", self.longest_unseen),
            ("throws.towards", throws.towards[0]),
            ("throws.towards", throws.towards[1]),
            ("throws.spread", throws.spread[0]),
            ("throws.spread", throws.spread[1]),
            ("throws.highest", throws.highest),
            ("throws.lowest", throws.lowest),
            ("throws.volume", throws.volume),
        ] {
            if !(value > 0.0 && value < 1e3) {
                return wrong(setting, "a number between 0 and 1000", value);
            }
        }
        Ok(())
    }
}

fn wrong(setting: &'static str, expected: &'static str, found: f64) -> Result<(), TrackError> {
    Err(TrackError::Setting {
        setting,
        expected,
        found,
    })
}

/// Error of the tracker. Unless stated otherwise, the input is ignored and nothing changes.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// A setting is out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Name of the setting.
        setting: &'static str,
        /// Expected value.
        expected: &'static str,
        /// Actual value.
        found: f64,
    },
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
