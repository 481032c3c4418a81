//! Settings of the tracker, and what can be wrong with what it is given.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::mht::{MAX_HYPOTHESES, MAX_SCANS};
use crate::flight::DRAG;

/// Circles of a picture that are no balls, where pictures show a room with people and round things (`tactnet bench catch-detect`).
pub const CLUTTER_OF_PICTURES: f64 = 24.0;

/// Settings of a [`BallTracker`](super::BallTracker).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrackConfig {
    /// Standard deviation of a circle's centre, each way, pixels.
    pub centre_noise: f64,
    /// Standard deviation of a circle's radius, pixels.
    pub radius_noise: f64,
    /// Part of a blurred ball's way during the exposure by which a detector's circle is off along it: 1 if the circle may come from any
    /// moment of the exposure, 0 if always from the middle.
    pub blur: f64,
    /// White acceleration, m/s^2 per square root of a hertz: after `t` seconds a velocity is unknown by this times the root of `t`. What
    /// 0.1 m/s^2, constant during the 40 ms from picture to picture and independent from one to the next, comes to is 0.02.
    pub acceleration_noise: f64,
    /// Drag of a ball, 1/m: mean and standard deviation.
    pub drag: [f64; 2],
    /// Random walk of the drag, 1/m per square root of a second.
    pub drag_walk: f64,
    /// Lift of a ball's spin along each axis, 1/s: standard deviation. Up to five rotations a second about any axis have 0.0075.
    pub lift: f64,
    /// Random walk of the lift, 1/s per square root of a second.
    pub lift_walk: f64,
    /// Probability that a ball in a picture is found.
    pub detection: f64,
    /// Circles of a picture that are no balls, mean number.
    pub clutter: f64,
    /// Their radii, pixels: least and greatest.
    pub clutter_radius: [f64; 2],
    /// Balls that appear, mean number from picture to picture.
    pub births: f64,
    /// Probability that a ball flies on from picture to picture.
    pub survival: f64,
    /// Square of the distance in standard deviations beyond which a circle is not a ball's; 99.9 % of chi square, 3 degrees of freedom.
    pub gate: f64,
    /// Best assignments of a picture's circles that are looked at for each hypothesis.
    pub assignments: usize,
    /// Pictures after which what was the best hypothesis is taken for true.
    pub scans: usize,
    /// Hypotheses, at most.
    pub hypotheses: usize,
    /// Hypotheses less probable than this, compared to the best one, are dropped.
    pub least_weight: f64,
    /// Balls are reported from this probability that they exist.
    pub report: f64,
    /// Longest time between two pictures that is bridged, s.
    pub longest_gap: f64,
    /// How long a ball flies on that neither camera can see, s.
    pub longest_unseen: f64,
    /// How balls are thrown.
    pub throws: ThrowPrior,
}

/// What is known of a ball before it is seen to move.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThrowPrior {
    /// Speed, m/s: least and greatest.
    pub speed: [f64; 2],
    /// Horizontal speed towards the robot, m/s: mean and standard deviation.
    pub towards: [f64; 2],
    /// Where throws go, from the head, inertial directions, m.
    pub aim: [f64; 3],
    /// Standard deviation of that, sideways and up, m.
    pub spread: [f64; 2],
    /// No ball flies higher than this, m.
    pub highest: f64,
    /// Nor appears lower than this, m.
    pub lowest: f64,
    /// Distance at which balls may appear, m: least and greatest.
    pub distance: [f64; 2],
    /// Volume within which balls appear, m^3.
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
    /// Returns the variances of u, v, r, px^2.
    pub(super) fn variances(&self) -> Vector3<f64> {
        let centre = self.centre_noise * self.centre_noise;
        Vector3::new(centre, centre, self.radius_noise * self.radius_noise)
    }

    pub(super) fn check(&self) -> Result<(), TrackError> {
        let wrong = |setting, expected, found: f64| {
            Err(TrackError::Setting {
                setting,
                expected,
                found,
            })
        };
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
                return wrong(setting, "[least, greatest], greater than 0", least);
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
                    "a count from 1 to what is documented",
                    value as f64,
                );
            }
        }
        Ok(())
    }
}

/// What is wrong with what a tracker was given. Unless said otherwise nothing of it is used and nothing changes.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum TrackError {
    /// A setting that makes no sense.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Setting {
        /// Its name.
        setting: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: f64,
    },
    /// Pictures that do not belong together.
    #[error(
        "expected the circles of both cameras' picture {left}, left first, found picture {right}"
    )]
    Pair {
        /// Number of the left picture.
        left: u64,
        /// Number of the right one.
        right: u64,
    },
    /// More circles than a packet holds.
    #[error("picture {frame}: expected up to {most} circles, found {found}", most = tactnet_catching_packets::packets::MAX_CIRCLES)]
    Count {
        /// Number of the picture.
        frame: u64,
        /// What the packet says.
        found: u32,
    },
    /// A circle that is none: not a number, no radius, far outside of the picture.
    #[error("picture {frame}: expected circles in pixels, found ({u}, {v}, {r})")]
    Circle {
        /// Number of the picture.
        frame: u64,
        /// The circle's centre.
        u: f64,
        /// The circle's centre.
        v: f64,
        /// The circle's radius.
        r: f64,
    },
    /// A pose of the head that is none, or of another moment.
    #[error(
        "expected the head's pose at {exposure_ns} ns, found one of {found_ns} ns or one that is no pose"
    )]
    Head {
        /// When the pictures were taken.
        exposure_ns: u64,
        /// Of when the pose is.
        found_ns: u64,
    },
    /// Pictures from before the last ones; they are ignored.
    #[error("expected pictures after {last_ns} ns, found some of {found_ns} ns")]
    Late {
        /// Of the last pictures.
        last_ns: u64,
        /// Of these.
        found_ns: u64,
    },
    /// Too long after the last pictures, or more than a second before them: a clock was set. All tracks end; the next pictures begin anew.
    #[error("no pictures between {last_ns} ns and {found_ns} ns; all tracks end")]
    Gap {
        /// Of the last pictures.
        last_ns: u64,
        /// Of these.
        found_ns: u64,
    },
}
