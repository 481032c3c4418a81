//! Robot description, `robot.toml`: geometry, limits, masses and sensors. [`RobotDescription::parse`] reads and
//! validates it.

use serde::Deserialize;

use crate::{ARM_JOINTS, ARMS, JOINTS, joint};

/// Description of the nominal robot.
const NOMINAL: &str = include_str!("robot.toml");

/// Error in a robot description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DescriptionError {
    /// Invalid TOML, an unknown or missing setting, or a value of the wrong type.
    #[error("{0}")]
    Syntax(String),
    /// Value out of range.
    #[error("`{setting}`: expected {expected}, found {found}")]
    Value {
        /// Name of the setting, with its tables.
        setting: String,
        /// Expected value.
        expected: &'static str,
        /// Actual value.
        found: String,
    },
}

/// Limits of a joint, in rad for a rotating and m for a sliding joint.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Lowest and highest position, in rad or m.
    pub range: [f64; 2],
    /// Maximum speed, in rad/s or m/s.
    pub speed: f64,
    /// Maximum acceleration, in rad/s^2 or m/s^2.
    pub acceleration: f64,
}

/// Rigid body, in the frame of the joint that moves it.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Mass, in kg.
    pub mass: f64,
    /// Centre of mass, in m.
    pub centre: [f64; 3],
    /// Principal moments of inertia about the centre of mass, in kg m^2. The principal axes are parallel to the frame.
    pub inertia: [f64; 3],
}

/// Platform that moves sideways, along y.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Platform {
    /// Limits of the axis.
    pub joint: Joint,
    /// Mass properties of the body.
    pub link: Link,
}

/// Torso: three joints about z, y and y, and a passive joint that keeps the chest upright.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Torso {
    /// Joint limits: vertical axis, lower pitch, upper pitch.
    pub joints: [Joint; 3],
    /// Height of the lower pitch axis above the floor, in m.
    pub lower_pitch_height: f64,
    /// Distance from the lower to the upper pitch axis, in m.
    pub lower_length: f64,
    /// Distance from the upper pitch axis to the chest frame, in m.
    pub upper_length: f64,
    /// Bodies: column, lower part, upper part, chest.
    pub links: [Link; 4],
}

/// Neck: pan about z, then tilt about y.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Neck {
    /// Joint limits: pan, tilt.
    pub joints: [Joint; 2],
    /// Height of the tilt axis above the chest frame, in m.
    pub height: f64,
    /// Bodies: neck, head.
    pub links: [Link; 2],
}

/// Stereo cameras. The head frame has x forward, y left, z up and its origin at the intersection of pan and tilt axis.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cameras {
    /// Midpoint between the cameras in the head frame, in m.
    pub centre: [f64; 3],
    /// Distance between the cameras along y, in m.
    pub baseline: f64,
    /// Width of a picture, in pixels.
    pub width: u32,
    /// Height of a picture, in pixels.
    pub height: u32,
    /// Focal length, in pixels.
    pub focal: f64,
    /// Exposure time, in s.
    pub exposure: f64,
    /// Frame rate, in Hz.
    pub rate: f64,
    /// Lens distortion k1 and k2. A ray through `(a, b)`, in focal lengths from the optical axis, is imaged at `(a, b)
    /// (1 + k1 s + k2 s^2)` with `s = a^2 + b^2`.
    #[serde(default)]
    pub distortion: [f64; 2],
    /// Offsets of the left and the right camera from their nominal positions (`centre` and `baseline`), in the head
    /// frame, in m.
    #[serde(default)]
    pub shifts: [[f64; 3]; 2],
}

/// Inertial measurement unit of the head, with axes parallel to the head frame.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Imu {
    /// Position in the head frame, in m.
    pub position: [f64; 3],
    /// Sample rate, in Hz.
    pub rate: f64,
}

/// Arm with joint axes z, -y, z, y, z, -y, z and spherical shoulder and wrist.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Arm {
    /// Mounting position in the chest frame, in m.
    pub position: [f64; 3],
    /// Rotation of the first axis from the vertical about the chest's x axis, in rad. Positive values turn z towards
    /// -y.
    pub lean: f64,
    /// Distance from the mounting to the shoulder, in m.
    pub base_to_shoulder: f64,
    /// Distance from shoulder to elbow, in m.
    pub shoulder_to_elbow: f64,
    /// Distance from elbow to wrist, in m.
    pub elbow_to_wrist: f64,
    /// Distance from the wrist to the catch frame along the last axis, in m.
    pub wrist_to_catch: f64,
    /// Joint limits, from the shoulder.
    pub joints: [Joint; ARM_JOINTS],
    /// Bodies, one behind each joint.
    pub links: [Link; ARM_JOINTS],
}

/// Description of the whole robot.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RobotDescription {
    /// Platform.
    pub platform: Platform,
    /// Torso.
    pub torso: Torso,
    /// Neck and head.
    pub neck: Neck,
    /// Stereo cameras.
    pub cameras: Cameras,
    /// Inertial measurement unit.
    pub imu: Imu,
    /// Arms: left, right.
    pub arms: [Arm; ARMS],
}

impl RobotDescription {
    /// Parses and validates a description.
    ///
    /// # Errors
    /// Returns an error if a setting is missing, unknown or of the wrong type, or if a value is invalid, such as an
    /// empty range or a speed of 0.
    pub fn parse(text: &str) -> Result<Self, DescriptionError> {
        let description: Self =
            toml::from_str(text).map_err(|error| DescriptionError::Syntax(error.to_string()))?;
        description.check()?;
        Ok(description)
    }

    /// Returns the nominal robot of the simulation. `robot.toml` states the sources of its numbers.
    pub fn nominal() -> Self {
        Self::parse(NOMINAL).expect("the built-in description is valid")
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
        each("torso.joints", &self.torso.joints, Joint::check)?;
        each("torso.links", &self.torso.links, Link::check)?;
        positive("torso.lower_pitch_height", self.torso.lower_pitch_height)?;
        positive("torso.lower_length", self.torso.lower_length)?;
        positive("torso.upper_length", self.torso.upper_length)?;
        each("neck.joints", &self.neck.joints, Joint::check)?;
        each("neck.links", &self.neck.links, Link::check)?;
        finite("neck.height", &[self.neck.height])?;
        self.cameras.check()?;
        finite("imu.position", &self.imu.position)?;
        positive("imu.rate", self.imu.rate)?;
        each("arms", &self.arms, Arm::check)
    }
}

impl Joint {
    fn check(&self, name: &str) -> Result<(), DescriptionError> {
        let [low, high] = self.range;
        let found = || format!("[{low}, {high}]");
        let ordered = low.is_finite() && high.is_finite() && low < high;
        ensure(
            ordered,
            &format!("{name}.range"),
            "[lowest, highest]",
            found,
        )?;
        positive(&format!("{name}.speed"), self.speed)?;
        positive(&format!("{name}.acceleration"), self.acceleration)
    }
}

impl Link {
    fn check(&self, name: &str) -> Result<(), DescriptionError> {
        positive(&format!("{name}.mass"), self.mass)?;
        finite(&format!("{name}.centre"), &self.centre)?;
        let [a, b, c] = self.inertia;
        let name = format!("{name}.inertia");
        for x in self.inertia {
            positive(&name, x)?;
        }
        let possible = a <= b + c && b <= a + c && c <= a + b;
        let expected = "moments that satisfy the triangle inequality";
        ensure(possible, &name, expected, || format!("[{a}, {b}, {c}]"))
    }
}

impl Cameras {
    fn check(&self) -> Result<(), DescriptionError> {
        finite("cameras.centre", &self.centre)?;
        finite("cameras.shifts", self.shifts.as_flattened())?;
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
        let expected = "less than the time between two pictures";
        let short = self.exposure * self.rate < 1.0;
        let found = || self.exposure.to_string();
        ensure(short, "cameras.exposure", expected, found)?;
        self.check_distortion()
    }

    /// Checks that the lens neither folds nor strongly scales the picture, up to 1.2 times the corner's radius.
    fn check_distortion(&self) -> Result<(), DescriptionError> {
        let corner = f64::from(self.width).hypot(f64::from(self.height)) / (2.0 * self.focal);
        let [k1, k2] = self.distortion;
        let scales_little = |part: i32| {
            let s = (corner * f64::from(part) / 20.0).powi(2);
            (0.5..2.0).contains(&(1.0 + s * (3.0 * k1 + 5.0 * s * k2)))
        };
        let expected = "a lens that scales the picture locally by 0.5 to 2";
        let found = || format!("{:?}", self.distortion);
        ensure(
            (0..=24).all(scales_little),
            "cameras.distortion",
            expected,
            found,
        )
    }
}

impl Arm {
    fn check(&self, name: &str) -> Result<(), DescriptionError> {
        let [x, y, z] = self.position;
        finite(&format!("{name}.position and lean"), &[x, y, z, self.lean])?;
        for (field, value) in [
            ("base_to_shoulder", self.base_to_shoulder),
            ("shoulder_to_elbow", self.shoulder_to_elbow),
            ("elbow_to_wrist", self.elbow_to_wrist),
            ("wrist_to_catch", self.wrist_to_catch),
        ] {
            positive(&format!("{name}.{field}"), value)?;
        }
        each(&format!("{name}.joints"), &self.joints, Joint::check)?;
        each(&format!("{name}.links"), &self.links, Link::check)
    }
}

/// Checks each of several parts, whose names have their index.
fn each<T>(
    name: &str,
    parts: &[T],
    check: fn(&T, &str) -> Result<(), DescriptionError>,
) -> Result<(), DescriptionError> {
    let mut parts = parts.iter().enumerate();
    parts.try_for_each(|(i, part)| check(part, &format!("{name}[{i}]")))
}

fn positive(setting: &str, value: f64) -> Result<(), DescriptionError> {
    let sound = value.is_finite() && value > 0.0;
    ensure(sound, setting, "a number greater than 0", || {
        value.to_string()
    })
}

fn finite(setting: &str, values: &[f64]) -> Result<(), DescriptionError> {
    let mut values = values.iter();
    values.try_for_each(|x| ensure(x.is_finite(), setting, "a finite number", || x.to_string()))
}

/// Returns an error unless a value is `sound`.
fn ensure(
    sound: bool,
    setting: &str,
    expected: &'static str,
    found: impl FnOnce() -> String,
) -> Result<(), DescriptionError> {
    if sound {
        return Ok(());
    }
    Err(DescriptionError::Value {
        setting: setting.into(),
        expected,
        found: found(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_values_are_reported_with_their_setting() {
        let cases = [
            ("[-0.5, 0.5]", "[0.5, -0.5]", "`platform.joint.range`"),
            ("speed = 1.4", "speed = 0.0", "`platform.joint.speed`"),
            ("speed = 1.4", "speed = nan", "`platform.joint.speed`"),
            ("focal = 1386.0", "focal = -1.0", "`cameras.focal`"),
            ("exposure = 0.002", "exposure = 0.05", "`cameras.exposure`"),
            ("[-0.08,", "[-0.9,", "`cameras.distortion`"),
            ("[-0.08,", "[nan,", "`cameras.distortion`"),
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
