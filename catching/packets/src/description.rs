//! The robot's description, `robot.toml`: geometry, limits, masses, sensors. Read with [`RobotDescription::parse`], which checks it.

use serde::Deserialize;

use crate::{ARM_JOINTS, ARMS, JOINTS, joint};

const NOMINAL: &str = include_str!("robot.toml");

/// What is wrong with a description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DescriptionError {
    /// Not TOML, an unknown or missing setting, a value of another kind.
    #[error("{0}")]
    Syntax(String),
    /// A value out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Value {
        /// Its name, with the tables that it is in.
        setting: String,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: String,
    },
}

/// A joint's limits; angles in radians, or metres for a sliding one.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Least and greatest position.
    pub range: [f64; 2],
    /// Greatest speed.
    pub speed: f64,
    /// Greatest acceleration.
    pub acceleration: f64,
}

/// A rigid body, in the frame of the joint that moves it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub centre: [f64; 3],
    /// Principal moments about the centre of mass, axes parallel to the frame's, kg m^2.
    pub inertia: [f64; 3],
}

/// A platform that rolls sideways, along y.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Platform {
    /// Its axis.
    pub joint: Joint,
    /// Its body.
    pub link: Link,
}

/// Three joints, about z, y, y, and a passive one that keeps the chest upright.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Torso {
    /// Vertical axis, lower pitch, upper pitch.
    pub joints: [Joint; 3],
    /// Height of the lower pitch axis over the floor, m.
    pub lower_pitch_height: f64,
    /// From the lower to the upper pitch axis, m.
    pub lower_length: f64,
    /// From the upper pitch axis to the chest's frame, m.
    pub upper_length: f64,
    /// Bodies: column, lower part, upper part, chest.
    pub links: [Link; 4],
}

/// Pan about z, then tilt about y.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Neck {
    /// Pan, tilt.
    pub joints: [Joint; 2],
    /// Height of the tilt axis over the chest's frame, m.
    pub height: f64,
    /// Bodies: neck, head.
    pub links: [Link; 2],
}

/// The stereo pair: x forward, y left, z up in the head's frame, whose origin is where pan and tilt axis cross.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cameras {
    /// Middle between the cameras, m, head's frame.
    pub centre: [f64; 3],
    /// Between the cameras, along y, m.
    pub baseline: f64,
    /// Picture, pixels.
    pub width: u32,
    /// Picture, pixels.
    pub height: u32,
    /// Focal length, pixels.
    pub focal: f64,
    /// Time that the shutter is open, s.
    pub exposure: f64,
    /// Pictures a second.
    pub rate: f64,
    /// Of the lens, k1 and k2: a ray through `(a, b)`, in focal lengths from the optical axis, falls on `(a, b) (1 + k1 s + k2 s^2)`,
    /// `s = a^2 + b^2`.
    #[serde(default)]
    pub distortion: [f64; 2],
    /// From where `centre` and `baseline` put the left and the right camera to where they are, m, head's frame.
    #[serde(default)]
    pub shifts: [[f64; 3]; 2],
}

/// The head's inertial unit, its axes parallel to the head's.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Imu {
    /// Where it sits, m, head's frame.
    pub position: [f64; 3],
    /// Samples a second.
    pub rate: f64,
}

/// An arm of the type z -y z y z -y z with spherical shoulder and wrist.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// Where it is mounted, m, chest's frame.
    pub position: [f64; 3],
    /// How far its first axis leans from the vertical, rad, about the chest's x axis; positive turns z towards -y.
    pub lean: f64,
    /// From the mounting to the shoulder, m.
    pub base_to_shoulder: f64,
    /// m.
    pub shoulder_to_elbow: f64,
    /// m.
    pub elbow_to_wrist: f64,
    /// From the wrist to the catch frame, along the last axis, m.
    pub wrist_to_catch: f64,
    /// From the shoulder.
    pub joints: [Joint; ARM_JOINTS],
    /// One behind each joint.
    pub links: [Link; ARM_JOINTS],
}

/// The whole robot.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDescription {
    /// Sideways motion.
    pub platform: Platform,
    /// Torso.
    pub torso: Torso,
    /// Neck and head.
    pub neck: Neck,
    /// Eyes.
    pub cameras: Cameras,
    /// Inertial unit.
    pub imu: Imu,
    /// Left, right.
    pub arms: [Arm; ARMS],
}

impl RobotDescription {
    /// Reads a description.
    ///
    /// # Errors
    /// Where a setting is missing, unknown or of another kind, and where a value makes no sense: a range upside down, a speed of 0.
    pub fn parse(text: &str) -> Result<Self, DescriptionError> {
        let description: Self =
            toml::from_str(text).map_err(|error| DescriptionError::Syntax(error.to_string()))?;
        description.check()?;
        Ok(description)
    }

    /// Returns the robot that simulations use where no other is named; its numbers and their sources stand in `robot.toml`.
    pub fn nominal() -> Self {
        Self::parse(NOMINAL).expect("the description in the sources is right")
    }

    /// Returns the text of [`RobotDescription::nominal`], to begin one's own with.
    pub fn nominal_text() -> &'static str {
        NOMINAL
    }

    /// Returns the limits of all joints, in the order of [`joint`].
    pub fn joints(&self) -> [Joint; JOINTS] {
        std::array::from_fn(|i| match i {
            joint::PLATFORM => self.platform.joint,
            1..4 => self.torso.joints[i - joint::TORSO.start],
            4..6 => self.neck.joints[i - joint::NECK.start],
            6..13 => self.arms[0].joints[i - joint::LEFT_ARM.start],
            _ => self.arms[1].joints[i - joint::RIGHT_ARM.start],
        })
    }

    fn check(&self) -> Result<(), DescriptionError> {
        self.platform.joint.check("platform.joint")?;
        self.platform.link.check("platform.link")?;
        for (i, joint) in self.torso.joints.iter().enumerate() {
            joint.check(&format!("torso.joints[{i}]"))?;
        }
        for (i, link) in self.torso.links.iter().enumerate() {
            link.check(&format!("torso.links[{i}]"))?;
        }
        positive("torso.lower_pitch_height", self.torso.lower_pitch_height)?;
        positive("torso.lower_length", self.torso.lower_length)?;
        positive("torso.upper_length", self.torso.upper_length)?;
        for (i, joint) in self.neck.joints.iter().enumerate() {
            joint.check(&format!("neck.joints[{i}]"))?;
        }
        for (i, link) in self.neck.links.iter().enumerate() {
            link.check(&format!("neck.links[{i}]"))?;
        }
        finite("neck.height", self.neck.height)?;
        self.cameras.check()?;
        for x in self.imu.position {
            finite("imu.position", x)?;
        }
        positive("imu.rate", self.imu.rate)?;
        for (i, arm) in self.arms.iter().enumerate() {
            arm.check(&format!("arms[{i}]"))?;
        }
        Ok(())
    }
}

impl Joint {
    fn check(&self, name: &str) -> Result<(), DescriptionError> {
        let [low, high] = self.range;
        if !(low.is_finite() && high.is_finite() && low < high) {
            return Err(DescriptionError::Value {
                setting: format!("{name}.range"),
                expected: "[least, greatest]",
                found: format!("[{low}, {high}]"),
            });
        }
        positive(&format!("{name}.speed"), self.speed)?;
        positive(&format!("{name}.acceleration"), self.acceleration)
    }
}

impl Link {
    fn check(&self, name: &str) -> Result<(), DescriptionError> {
        positive(&format!("{name}.mass"), self.mass)?;
        for x in self.centre {
            finite(&format!("{name}.centre"), x)?;
        }
        for x in self.inertia {
            positive(&format!("{name}.inertia"), x)?;
        }
        let [a, b, c] = self.inertia;
        if a > b + c || b > a + c || c > a + b {
            return Err(DescriptionError::Value {
                setting: format!("{name}.inertia"),
                expected: "moments of which none is greater than the sum of the others",
                found: format!("[{a}, {b}, {c}]"),
            });
        }
        Ok(())
    }
}

impl Cameras {
    fn check(&self) -> Result<(), DescriptionError> {
        for x in self.centre {
            finite("cameras.centre", x)?;
        }
        for x in self.shifts.as_flattened() {
            finite("cameras.shifts", *x)?;
        }
        for (name, value) in [
            ("cameras.baseline", self.baseline),
            ("cameras.width", f64::from(self.width)),
            ("cameras.height", f64::from(self.height)),
            ("cameras.focal", self.focal),
            ("cameras.exposure", self.exposure),
            ("cameras.rate", self.rate),
        ] {
            positive(name, value)?;
        }
        if self.exposure * self.rate >= 1.0 {
            return Err(DescriptionError::Value {
                setting: "cameras.exposure".into(),
                expected: "less than the time between two pictures",
                found: self.exposure.to_string(),
            });
        }
        self.check_distortion()
    }

    /// Out to a little beyond the picture's corners, the lens must not fold the picture or squeeze it much.
    fn check_distortion(&self) -> Result<(), DescriptionError> {
        let corner = f64::from(self.width).hypot(f64::from(self.height)) / (2.0 * self.focal);
        let [k1, k2] = self.distortion;
        for part in 0..=24 {
            let s = (corner * f64::from(part) / 20.0).powi(2);
            let stretch = 1.0 + s * (3.0 * k1 + 5.0 * s * k2);
            if !(0.5..2.0).contains(&stretch) {
                return Err(DescriptionError::Value {
                    setting: "cameras.distortion".into(),
                    expected: "a lens that stretches no part of the picture to less than half or more than twice",
                    found: format!("{:?}", self.distortion),
                });
            }
        }
        Ok(())
    }
}

impl Arm {
    fn check(&self, name: &str) -> Result<(), DescriptionError> {
        for x in self.position.into_iter().chain([self.lean]) {
            finite(&format!("{name}.position and lean"), x)?;
        }
        for (field, value) in [
            ("base_to_shoulder", self.base_to_shoulder),
            ("shoulder_to_elbow", self.shoulder_to_elbow),
            ("elbow_to_wrist", self.elbow_to_wrist),
            ("wrist_to_catch", self.wrist_to_catch),
        ] {
            positive(&format!("{name}.{field}"), value)?;
        }
        for (i, joint) in self.joints.iter().enumerate() {
            joint.check(&format!("{name}.joints[{i}]"))?;
        }
        for (i, link) in self.links.iter().enumerate() {
            link.check(&format!("{name}.links[{i}]"))?;
        }
        Ok(())
    }
}

fn positive(setting: &str, value: f64) -> Result<(), DescriptionError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(DescriptionError::Value {
        setting: setting.into(),
        expected: "a number greater than 0",
        found: value.to_string(),
    })
}

fn finite(setting: &str, value: f64) -> Result<(), DescriptionError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(DescriptionError::Value {
        setting: setting.into(),
        expected: "a number",
        found: value.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_makes_no_sense_is_named_with_its_setting() {
        let cases = [
            (
                "range = [-0.5, 0.5]",
                "range = [0.5, -0.5]",
                "`platform.joint.range`",
            ),
            ("speed = 1.4", "speed = 0.0", "`platform.joint.speed`"),
            ("speed = 1.4", "speed = nan", "`platform.joint.speed`"),
            ("focal = 1386.0", "focal = -1.0", "`cameras.focal`"),
            ("exposure = 0.002", "exposure = 0.05", "`cameras.exposure`"),
            (
                "distortion = [-0.08,",
                "distortion = [-0.9,",
                "`cameras.distortion`",
            ),
            (
                "distortion = [-0.08,",
                "distortion = [nan,",
                "`cameras.distortion`",
            ),
            (
                "rate = 25.0",
                "rate = 25.0\nshifts = [[0.0, 0.0, nan], [0.0, 0.0, 0.0]]",
                "`cameras.shifts`",
            ),
            ("height = 0.25", "hight = 0.25", "hight"),
        ];
        for (from, to, named) in cases {
            assert!(NOMINAL.contains(from), "{from}");
            let error = RobotDescription::parse(&NOMINAL.replacen(from, to, 1)).unwrap_err();
            assert!(error.to_string().contains(named), "{error}");
        }
    }

    #[test]
    fn joints_stand_where_their_numbers_say() {
        let robot = RobotDescription::nominal();
        let joints = robot.joints();
        assert_eq!(joints[joint::PLATFORM], robot.platform.joint);
        assert_eq!(joints[joint::TORSO], robot.torso.joints);
        assert_eq!(joints[joint::NECK], robot.neck.joints);
        for arm in 0..ARMS {
            assert_eq!(joints[joint::ARM[arm].clone()], robot.arms[arm].joints);
        }
    }
}
