//! The unknowns: order, names and priors.

use nalgebra::{DVector, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::checks::positive;

use super::error::CalibrationError;
use crate::track::CAMERAS;

/// Number of unknowns.
pub const UNKNOWNS: usize = 79;
/// Names of arms and cameras in messages.
pub(crate) const ARM_NAMES: [&str; 2] = ["left", "right"];

/// Values of all unknowns, in the order of [`at`].
pub type Unknowns = DVector<f64>;

/// Indices of the unknowns.
pub mod at {
    /// Index of a camera's focal length in pixels, its first unknown.
    pub const fn camera(camera: usize) -> usize {
        11 * camera
    }
    /// Offset within a camera: principal point (2), in pixels.
    pub const CENTRE: usize = 1;
    /// Offset within a camera: remaining distortion k1 and k2.
    pub const DISTORTION: usize = 3;
    /// Offset within a camera: rotation vector from the camera frame to the head frame, in rad.
    pub const TURN: usize = 5;
    /// Offset within a camera: position minus the described one, in the head frame, in m.
    pub const SHIFT: usize = 8;
    /// Index of the marker position in the frame of the arm's last link (3), in m.
    pub const fn marker(arm: usize) -> usize {
        22 + 3 * arm
    }
    /// Index of the joint offsets of an arm (7), in rad.
    pub const fn offsets(arm: usize) -> usize {
        28 + 7 * arm
    }
    /// Index of the joint compliances of an arm (7), in rad/Nm.
    pub const fn compliances(arm: usize) -> usize {
        42 + 7 * arm
    }
    /// Index of the mounting position minus the described one (3), in the chest frame, in m.
    pub const fn mount(arm: usize) -> usize {
        56 + 3 * arm
    }
    /// Index of the offsets of pan and tilt, in rad.
    pub const NECK: usize = 62;
    /// Index of the rotation vector from the IMU frame to the head frame (3), in rad.
    pub const IMU_TURN: usize = 64;
    /// Index of the accelerometer bias (3), in m/s^2.
    pub const ACCELEROMETER_BIAS: usize = 67;
    /// Index of the gyroscope bias (3), in rad/s.
    pub const GYROSCOPE_BIAS: usize = 70;
    /// Index of the lengths shoulder to elbow and elbow to wrist minus the described ones (2), in m.
    pub const fn lengths(arm: usize) -> usize {
        75 + 2 * arm
    }
    /// Index of the delay of picture time stamps relative to joint time stamps, in s.
    pub const CAMERA_JOINTS: usize = 73;
    /// Index of the delay of picture time stamps relative to IMU time stamps, in s.
    pub const CAMERA_IMU: usize = 74;
}

/// Returns an unknown's name with its unit.
///
/// # Panics
/// Panics unless `unknown` is less than [`UNKNOWNS`].
pub fn name(unknown: usize) -> String {
    assert!(unknown < UNKNOWNS, "there are {UNKNOWNS} unknowns");
    let axis = |i: usize| ["x", "y", "z"][i % 3];
    let camera = |place: usize| match place {
        0 => "focal length, px".to_string(),
        1 | 2 => format!("picture's middle {}, px", ["u", "v"][place - 1]),
        3 | 4 => format!("distortion k{}", place - 2),
        5..8 => format!("turn {}, rad", axis(place - 5)),
        _ => format!("shift {}, m", axis(place - 8)),
    };
    let of_arm = |first: usize, size: usize, what: &str| {
        let (arm, place) = ((unknown - first) / size, (unknown - first) % size);
        let place = if size == 3 {
            axis(place).to_string()
        } else {
            (place + 1).to_string()
        };
        let (what, unit) = what.split_once(", ").unwrap_or((what, ""));
        format!("{} arm {what} {place}, {unit}", ARM_NAMES[arm])
    };
    match unknown {
        0..22 => ARM_NAMES[unknown / 11].to_string() + " camera " + &camera(unknown % 11),
        22..28 => of_arm(22, 3, "marker, m"),
        28..42 => of_arm(28, 7, "offset, rad"),
        42..56 => of_arm(42, 7, "compliance, rad/Nm"),
        56..62 => of_arm(56, 3, "mount, m"),
        62..64 => format!("neck offset {}, rad", ["pan", "tilt"][unknown - 62]),
        64..67 => format!("inertial unit turn {}, rad", axis(unknown - 64)),
        67..70 => format!("accelerometer bias {}, m/s^2", axis(unknown - 67)),
        70..73 => format!("gyroscope bias {}, rad/s", axis(unknown - 70)),
        73 => "clock of cameras after joints, s".into(),
        74 => "clock of cameras after inertial unit, s".into(),
        _ => of_arm(75, 2, "length, m"),
    }
}

tactnet_catching_packets::settings! {
    /// Priors of the unknowns: initial guesses and standard deviations.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Priors in "priors.": CalibrationError {
        /// Marker positions in the frame of the arm's last link, in m.
        pub markers: [[f64; 3]; ARMS] = [[0.05, 0.04, 0.06], [0.05, -0.04, 0.06]],
        /// Standard deviation of the marker positions, in m.
        pub marker: f64 = 0.015 => positive,
        /// Guess of an arm joint's compliance, in rad/Nm.
        pub compliance_guess: f64 = 1e-4,
        /// Standard deviation of the compliances, in rad/Nm.
        pub compliance: f64 = 5e-5 => positive,
        /// Standard deviation of the focal length, in pixels.
        pub focal: f64 = 10.0 => positive,
        /// Standard deviation of the principal point, in pixels.
        pub centre: f64 = 8.0 => positive,
        /// Standard deviation of distortion k1 and k2.
        pub distortion: f64 = 0.02 => positive,
        /// Standard deviation of a camera's rotation, in rad.
        pub camera_turn: f64 = 0.02 => positive,
        /// Standard deviation of a camera's position, in m.
        pub camera_shift: f64 = 0.006 => positive,
        /// Standard deviation of an arm's joint offsets, in rad.
        pub arm_offset: f64 = 0.03 => positive,
        /// Standard deviation of an arm's mounting position, in m.
        pub arm_mount: f64 = 0.008 => positive,
        /// Standard deviation of an arm's lengths, in m.
        pub arm_length: f64 = 0.001 => positive,
        /// Standard deviation of the offsets of pan and tilt, in rad.
        pub neck_offset: f64 = 0.02 => positive,
        /// Standard deviation of the IMU's rotation, in rad.
        pub imu_turn: f64 = 0.03 => positive,
        /// Standard deviation of the accelerometer bias, in m/s^2.
        pub accelerometer_bias: f64 = 0.1 => positive,
        /// Standard deviation of the gyroscope bias, in rad/s.
        pub gyroscope_bias: f64 = 0.01 => positive,
        /// Standard deviation of the clock delays, in s.
        pub clock: f64 = 0.01 => positive,
    }
}

impl Priors {
    /// Returns the initial guesses, which are zero except for markers and compliances.
    pub fn guess(&self) -> Unknowns {
        let mut guess = Unknowns::zeros(UNKNOWNS);
        for arm in 0..ARMS {
            let marker = Vector3::from(self.markers[arm]);
            let (markers, compliances) = (at::marker(arm), at::compliances(arm));
            guess.fixed_rows_mut::<3>(markers).copy_from(&marker);
            let mut compliances = guess.fixed_rows_mut::<7>(compliances);
            compliances.fill(self.compliance_guess);
        }
        guess
    }

    /// Returns the standard deviations of all unknowns.
    ///
    /// # Errors
    /// Returns an error if one is not greater than 0.
    pub fn sigmas(&self) -> Result<Unknowns, CalibrationError> {
        self.check_settings()?;
        let mut sigmas = Unknowns::zeros(UNKNOWNS);
        let mut fill = |first: usize, count: usize, sigma: f64| {
            sigmas.rows_mut(first, count).fill(sigma);
        };
        for camera in 0..CAMERAS {
            let first = at::camera(camera);
            fill(first, 1, self.focal);
            fill(first + at::CENTRE, 2, self.centre);
            fill(first + at::DISTORTION, 2, self.distortion);
            fill(first + at::TURN, 3, self.camera_turn);
            fill(first + at::SHIFT, 3, self.camera_shift);
        }
        for arm in 0..ARMS {
            fill(at::marker(arm), 3, self.marker);
            fill(at::offsets(arm), 7, self.arm_offset);
            fill(at::compliances(arm), 7, self.compliance);
            fill(at::mount(arm), 3, self.arm_mount);
            fill(at::lengths(arm), 2, self.arm_length);
        }
        fill(at::NECK, 2, self.neck_offset);
        fill(at::IMU_TURN, 3, self.imu_turn);
        fill(at::ACCELEROMETER_BIAS, 3, self.accelerometer_bias);
        fill(at::GYROSCOPE_BIAS, 3, self.gyroscope_bias);
        fill(at::CAMERA_JOINTS, 2, self.clock);
        Ok(sigmas)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unknown_has_a_name_of_its_own_and_a_prior() {
        let names: std::collections::BTreeSet<String> = (0..UNKNOWNS).map(name).collect();
        assert_eq!(names.len(), UNKNOWNS);
        assert!(names.contains("right arm offset 7, rad"));
        assert!(names.contains("left camera shift z, m"));
        let sigmas = Priors::default().sigmas().unwrap();
        assert!(sigmas.iter().all(|sigma| *sigma > 0.0));
    }

    #[test]
    fn a_prior_that_is_none_is_named() {
        let priors = Priors {
            clock: 0.0,
            ..Priors::default()
        };
        let error = priors.sigmas().unwrap_err().to_string();
        assert!(error.contains("priors.clock"), "{error}");
    }
}
