//! Robot description, `robot.toml`: geometry, limits, masses and sensors. [`RobotDescription::parse`] reads and
//! validates it.

use serde::Deserialize;

use crate::settings::Numbers;
use crate::{ARM_JOINTS, ARMS, JOINTS, joint};

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

/// Defines parts of a description and their checks: functions of the setting's name and its value.
macro_rules! parts {
    ($(
        $(#[$attribute:meta])*
        pub struct $name:ident {
            $($(#[$of_field:meta])* pub $field:ident: $type:ty $(=> $check:expr)?,)*
        }
    )*) => { $(
        $(#[$attribute])*
        #[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct $name {
            $($(#[$of_field])* pub $field: $type,)*
        }

        impl $name {
            fn check(name: &str, part: &Self) -> Result<(), DescriptionError> {
                $($($check(&format!("{name}.{}", stringify!($field)), &part.$field)?;)?)*
                Ok(())
            }
        }
    )* };
}

parts! {
    /// Limits of a joint, in rad for a rotating and m for a sliding joint.
    pub struct Joint {
        /// Lowest and highest position, in rad or m.
        pub range: [f64; 2] => ordered,
        /// Maximum speed, in rad/s or m/s.
        pub speed: f64 => positive,
        /// Maximum acceleration, in rad/s^2 or m/s^2.
        pub acceleration: f64 => positive,
    }

    /// Rigid body, in the frame of the joint that moves it.
    pub struct Link {
        /// Mass, in kg.
        pub mass: f64 => positive,
        /// Centre of mass, in m.
        pub centre: [f64; 3] => finite,
        /// Principal moments of inertia about the centre of mass, in kg m^2. The principal axes are parallel to the frame.
        pub inertia: [f64; 3] => moments,
    }

    /// Platform that moves sideways, along y.
    pub struct Platform {
        /// Limits of the axis.
        pub joint: Joint => Joint::check,
        /// Mass properties of the body.
        pub link: Link => Link::check,
    }

    /// Torso: three joints about z, y and y, and a passive joint that keeps the chest upright.
    pub struct Torso {
        /// Joint limits: vertical axis, lower pitch, upper pitch.
        pub joints: [Joint; 3] => each(Joint::check),
        /// Height of the lower pitch axis above the floor, in m.
        pub lower_pitch_height: f64 => positive,
        /// Distance from the lower to the upper pitch axis, in m.
        pub lower_length: f64 => positive,
        /// Distance from the upper pitch axis to the chest frame, in m.
        pub upper_length: f64 => positive,
        /// Bodies: column, lower part, upper part, chest.
        pub links: [Link; 4] => each(Link::check),
    }

    /// Neck: pan about z, then tilt about y.
    pub struct Neck {
        /// Joint limits: pan, tilt.
        pub joints: [Joint; 2] => each(Joint::check),
        /// Height of the tilt axis above the chest frame, in m.
        pub height: f64 => finite,
        /// Bodies: neck, head.
        pub links: [Link; 2] => each(Link::check),
    }

    /// Stereo cameras. The head frame has x forward, y left, z up and its origin at the intersection of pan and tilt axis.
    pub struct Cameras {
        /// Midpoint between the cameras in the head frame, in m.
        pub centre: [f64; 3] => finite,
        /// Distance between the cameras along y, in m.
        pub baseline: f64 => positive,
        /// Width of a picture, in pixels.
        pub width: u32 => positive,
        /// Height of a picture, in pixels.
        pub height: u32 => positive,
        /// Focal length, in pixels.
        pub focal: f64 => positive,
        /// Exposure time, in s.
        pub exposure: f64 => positive,
        /// Frame rate, in Hz.
        pub rate: f64 => positive,
        /// Lens distortion k1 and k2. A ray through `(a, b)`, in focal lengths from the optical axis, is imaged at `(a, b)
        /// (1 + k1 s + k2 s^2)` with `s = a^2 + b^2`.
        #[serde(default)]
        pub distortion: [f64; 2],
        /// Offsets of the left and the right camera from their nominal positions (`centre` and `baseline`), in the head
        /// frame, in m.
        #[serde(default)]
        pub shifts: [[f64; 3]; 2] => finite,
    }

    /// Inertial measurement unit of the head, with axes parallel to the head frame.
    pub struct Imu {
        /// Position in the head frame, in m.
        pub position: [f64; 3] => finite,
        /// Sample rate, in Hz.
        pub rate: f64 => positive,
    }

    /// Arm with joint axes z, -y, z, y, z, -y, z and spherical shoulder and wrist.
    pub struct Arm {
        /// Mounting position in the chest frame, in m.
        pub position: [f64; 3] => finite,
        /// Rotation of the first axis from the vertical about the chest's x axis, in rad. Positive values turn z towards
        /// -y.
        pub lean: f64 => finite,
        /// Distance from the mounting to the shoulder, in m.
        pub base_to_shoulder: f64 => positive,
        /// Distance from shoulder to elbow, in m.
        pub shoulder_to_elbow: f64 => positive,
        /// Distance from elbow to wrist, in m.
        pub elbow_to_wrist: f64 => positive,
        /// Distance from the wrist to the catch frame along the last axis, in m.
        pub wrist_to_catch: f64 => positive,
        /// Joint limits, from the shoulder.
        pub joints: [Joint; ARM_JOINTS] => each(Joint::check),
        /// Bodies, one behind each joint.
        pub links: [Link; ARM_JOINTS] => each(Link::check),
    }
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
        Platform::check("platform", &self.platform)?;
        Torso::check("torso", &self.torso)?;
        Neck::check("neck", &self.neck)?;
        Cameras::check("cameras", &self.cameras)?;
        let Cameras { exposure, rate, .. } = self.cameras;
        let expected = "less than the time between two pictures";
        let found = || exposure.to_string();
        ensure(exposure * rate < 1.0, "cameras.exposure", expected, found)?;
        self.cameras.check_distortion()?;
        Imu::check("imu", &self.imu)?;
        each(Arm::check)("arms", &self.arms)
    }
}

impl Cameras {
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

/// Returns a check of several parts, whose names have their index.
fn each<T>(
    check: fn(&str, &T) -> Result<(), DescriptionError>,
) -> impl Fn(&str, &[T]) -> Result<(), DescriptionError> {
    move |name, parts| {
        let mut parts = parts.iter().enumerate();
        parts.try_for_each(|(i, part)| check(&format!("{name}[{i}]"), part))
    }
}

fn positive(setting: &str, value: &impl Numbers) -> Result<(), DescriptionError> {
    let is_sound = |x: f64| x.is_finite() && x > 0.0;
    numbers(setting, value, "a number greater than 0", is_sound)
}

fn finite(setting: &str, value: &impl Numbers) -> Result<(), DescriptionError> {
    numbers(setting, value, "a finite number", f64::is_finite)
}

fn numbers(
    setting: &str,
    value: &impl Numbers,
    expected: &'static str,
    is_sound: fn(f64) -> bool,
) -> Result<(), DescriptionError> {
    let mut numbers = value.numbers();
    numbers.try_for_each(|x| ensure(is_sound(x), setting, expected, || x.to_string()))
}

fn ordered(setting: &str, range: &[f64; 2]) -> Result<(), DescriptionError> {
    let [low, high] = range;
    let ordered = low.is_finite() && high.is_finite() && low < high;
    ensure(ordered, setting, "[lowest, highest]", || {
        format!("{range:?}")
    })
}

fn moments(setting: &str, inertia: &[f64; 3]) -> Result<(), DescriptionError> {
    positive(setting, inertia)?;
    let [a, b, c] = inertia;
    let possible = *a <= b + c && *b <= a + c && *c <= a + b;
    let expected = "moments that satisfy the triangle inequality";
    ensure(possible, setting, expected, || format!("{inertia:?}"))
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
