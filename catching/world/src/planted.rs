//! Planted errors: deviations of the true robot from its description.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitSphere};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, RobotDescription, joint};

use crate::cameras::CAMERAS;

use crate::error::{WorldError, not_negative};
use crate::stream::Stream;

/// Distance of the platform after which its slip approaches the maximum, in m; an assumption.
const SLIP_WAY: f64 = 0.15;

tactnet_catching_packets::settings! {
    /// Planted errors. Geometric errors have the given size and a random direction, drawn for the run or for the robot
    /// of [`PlantedErrors::robot`]. Maximum errors are drawn uniformly with either sign.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct PlantedErrors in "errors.": WorldError {
        /// Maximum slip of the platform's wheels, in m; drawn for each run.
        pub platform_slip: f64 = 0.006 => not_negative,
        /// Displacement of the arm mounts, in m.
        pub arm_mount: f64 = 0.0 => not_negative,
        /// Common displacement of the cameras, in m.
        pub camera_mount: f64 = 0.0 => not_negative,
        /// Common rotation of the cameras, in rad.
        pub camera_turn: f64 = 0.0 => not_negative,
        /// Additional displacement of each camera, in m.
        pub each_camera_mount: f64 = 0.0 => not_negative,
        /// Additional rotation of each camera, in rad.
        pub each_camera_turn: f64 = 0.0 => not_negative,
        /// Maximum error of the focal length of each camera, in pixels.
        pub focal: f64 = 0.0 => not_negative,
        /// Maximum error of the principal point along each axis, in pixels.
        pub centre: f64 = 0.0 => not_negative,
        /// Maximum residual distortion k1 of each lens, and twice the maximum of k2, in the form of the description's
        /// `distortion`.
        pub distortion: f64 = 0.0 => not_negative,
        /// Maximum error of the lengths of the arms' links, in m. Markers do not reveal the last one, from the wrist to
        /// the catch frame.
        pub arm_length: f64 = 0.0 => not_negative,
        /// Maximum zero offset of the arms' joints, in rad.
        pub arm_offset: f64 = 0.0 => not_negative,
        /// Compliance of the arms' joints, in rad/Nm; the factor for each joint is drawn from 0.5 to 1.5. Arms bend
        /// under their weight only, not under dynamic torques.
        pub arm_compliance: f64 = 0.0 => not_negative,
        /// Maximum zero offset of the neck's joints, in rad.
        pub neck_offset: f64 = 0.0 => not_negative,
        /// Displacement of the markers, in m.
        pub marker: f64 = 0.0 => not_negative,
        /// Rotation of the inertial unit, in rad.
        pub imu_turn: f64 = 0.0 => not_negative,
        /// Maximum delay of picture timestamps, in s; never negative.
        pub camera_clock: f64 = 0.0 => not_negative,
        /// Maximum delay of timestamps of the inertial unit, in s; never negative.
        pub imu_clock: f64 = 0.0 => not_negative,
        /// Mean of the exponentially distributed jitter of the timestamps of pictures and the inertial unit, in s.
        pub stamp_jitter: f64 = 0.0 => not_negative,
        /// Number of the robot. Runs with the same number share the same errors, whatever their seed. The slip of the
        /// wheels is still drawn for each run.
        pub robot: Option<u64> = None,
    }
}

/// Delay of the timestamps of a sensor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StampDelay {
    constant_ns: u64,
    /// Mean of the jitter, in ns.
    jitter_ns: f64,
    seed: u64,
    /// Number of the sensor.
    sensor: u64,
}

impl StampDelay {
    /// Returns the delay of a packet by its number, in ns.
    pub(crate) fn of(&self, number: u64) -> u64 {
        if self.jitter_ns == 0.0 {
            return self.constant_ns;
        }
        let mut rng = Stream::StampJitter.rng(self.seed, number << 1 | self.sensor);
        let jitter = -self.jitter_ns * (1.0 - rng.random::<f64>()).ln();
        self.constant_ns + jitter.round() as u64
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraErrors {
    /// Displacement in the head frame, in m.
    pub(crate) shift: Vector3<f64>,
    /// Rotation from its frame to the frame of a camera mounted as described.
    pub(crate) turn: Matrix3<f64>,
    /// Error of the focal length, in pixels.
    pub(crate) focal: f64,
    /// Error of the principal point, in pixels.
    pub(crate) centre: [f64; 2],
    /// Distortion coefficients k1 and k2.
    pub(crate) distortion: [f64; 2],
}

impl CameraErrors {
    /// Returns true if both cameras have the same lens.
    pub(crate) fn has_lens_of(&self, other: &Self) -> bool {
        let lens = |of: &Self| (of.focal, of.centre, of.distortion);
        lens(self) == lens(other)
    }
}

/// Errors of the joint sensors: `q_link = q + offset + compliance * load`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct JointErrors {
    /// Zero offsets, in rad.
    pub(crate) offsets: [f64; JOINTS],
    /// Compliances, in rad/Nm.
    pub(crate) compliances: [f64; JOINTS],
}

impl PlantedErrors {
    /// Returns the errors of an assembled robot without calibration. Seen from a camera, its hands are up to about 60
    /// mm from their expected places (Agile Justin: 61 mm, arXiv 2311.08338).
    ///
    /// - `robot`: number of the robot
    pub fn uncalibrated(robot: u64) -> Self {
        Self {
            arm_mount: 0.008,
            arm_length: 0.001,
            camera_mount: 0.006,
            camera_turn: 0.015,
            each_camera_mount: 0.002,
            each_camera_turn: 0.006,
            focal: 10.0,
            centre: 8.0,
            distortion: 0.015,
            arm_offset: 0.026,
            arm_compliance: 1e-4,
            neck_offset: 0.02,
            marker: 0.015,
            imu_turn: 0.03,
            camera_clock: 0.006,
            imu_clock: 0.004,
            robot: Some(robot),
            ..Self::default()
        }
    }

    /// Draws the displacements of the arm mounts in the chest frame, in m.
    pub(crate) fn arm_mounts(&self, seed: u64) -> [Vector3<f64>; ARMS] {
        std::array::from_fn(|arm| {
            direction(&mut Stream::ArmMount.rng(self.of(seed), arm as u64)) * self.arm_mount
        })
    }

    /// Draws the common displacement (in m) and rotation of the cameras in the head frame.
    pub(crate) fn camera_mount(&self, seed: u64) -> (Vector3<f64>, Matrix3<f64>) {
        let mut rng = Stream::CameraMount.rng(self.of(seed), 0);
        let shift = direction(&mut rng) * self.camera_mount;
        (shift, turned(self.camera_turn, &mut rng))
    }

    /// Draws the additional errors of each camera.
    pub(crate) fn each_camera(&self, seed: u64) -> [CameraErrors; CAMERAS] {
        std::array::from_fn(|camera| {
            let mut rng = Stream::EachCamera.rng(self.of(seed), camera as u64);
            let shift = direction(&mut rng) * self.each_camera_mount;
            let turn = turned(self.each_camera_turn, &mut rng);
            CameraErrors {
                shift,
                turn,
                focal: up_to(self.focal, &mut rng),
                centre: std::array::from_fn(|_| up_to(self.centre, &mut rng)),
                distortion: [1.0, 0.5].map(|part| up_to(part * self.distortion, &mut rng)),
            }
        })
    }

    /// Draws the lengths of the arms' links and returns the changed description.
    pub(crate) fn lengths(&self, description: &RobotDescription, seed: u64) -> RobotDescription {
        let mut drawn = description.clone();
        for (number, arm) in drawn.arms.iter_mut().enumerate() {
            let mut rng = Stream::ArmLengths.rng(self.of(seed), number as u64);
            for length in [
                &mut arm.base_to_shoulder,
                &mut arm.shoulder_to_elbow,
                &mut arm.elbow_to_wrist,
                &mut arm.wrist_to_catch,
            ] {
                *length += up_to(self.arm_length, &mut rng);
            }
        }
        drawn
    }

    /// Draws the errors of the joints; `None` if there are none.
    pub(crate) fn joints(&self, seed: u64) -> Option<JointErrors> {
        if [self.arm_offset, self.arm_compliance, self.neck_offset] == [0.0; 3] {
            return None;
        }
        let mut errors = JointErrors::default();
        for (arm, own) in joint::ARM.iter().enumerate() {
            let mut rng = Stream::ArmJoints.rng(self.of(seed), arm as u64);
            for i in 0..ARM_JOINTS {
                errors.offsets[own.start + i] = up_to(self.arm_offset, &mut rng);
                errors.compliances[own.start + i] =
                    self.arm_compliance * (0.5 + rng.random::<f64>());
            }
        }
        let mut rng = Stream::NeckJoints.rng(self.of(seed), 0);
        for offset in &mut errors.offsets[joint::NECK] {
            *offset = up_to(self.neck_offset, &mut rng);
        }
        Some(errors)
    }

    /// Draws the displacements of the markers in the frame of the arm's last link, in m.
    pub(crate) fn markers(&self, seed: u64) -> [Vector3<f64>; ARMS] {
        std::array::from_fn(|arm| {
            direction(&mut Stream::MarkerPlace.rng(self.of(seed), arm as u64)) * self.marker
        })
    }

    /// Draws the rotation from the frame of the inertial unit to the head frame.
    pub(crate) fn imu_turn(&self, seed: u64) -> Matrix3<f64> {
        turned(self.imu_turn, &mut Stream::ImuTurn.rng(self.of(seed), 0))
    }

    /// Draws the delays of the timestamps of pictures and of the inertial unit.
    pub(crate) fn clocks(&self, seed: u64) -> [StampDelay; 2] {
        let mut rng = Stream::Clocks.rng(self.of(seed), 0);
        let delays = [(self.camera_clock, 0), (self.imu_clock, 1)];
        delays.map(|(most, sensor)| StampDelay {
            constant_ns: (rng.random::<f64>() * most * 1e9).round() as u64,
            jitter_ns: self.stamp_jitter * 1e9,
            seed,
            sensor,
        })
    }

    /// Returns the seed of the geometric errors.
    fn of(&self, seed: u64) -> u64 {
        self.robot.unwrap_or(seed)
    }

    /// Draws the slip of the platform, which starts at `start`, in m.
    pub(crate) fn slip(&self, seed: u64, start: f64) -> Slip {
        let part = Stream::Slip.rng(seed, 0).random::<f64>() * 2.0 - 1.0;
        Slip {
            start,
            most: self.platform_slip * part,
        }
    }
}

fn up_to(most: f64, rng: &mut ChaCha8Rng) -> f64 {
    most * (2.0 * rng.random::<f64>() - 1.0)
}

fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    let direction: [f64; 3] = UnitSphere.sample(rng);
    direction.into()
}

fn turned(angle: f64, rng: &mut ChaCha8Rng) -> Matrix3<f64> {
    let axis = Unit::new_normalize(direction(rng));
    Rotation3::from_axis_angle(&axis, angle).into_inner()
}

/// Slip of the wheels: `s = most tanh(distance / SLIP_WAY)`, which grows smoothly with the distance.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slip {
    start: f64,
    most: f64,
}

impl Slip {
    /// Returns the slip, in m.
    pub(crate) fn at(&self, q: f64) -> f64 {
        self.most * ((q - self.start) / SLIP_WAY).tanh()
    }

    /// Returns position, velocity and acceleration of the platform for those of its drive.
    pub(crate) fn apply(&self, [q, dq, ddq]: [f64; 3]) -> [f64; 3] {
        let tanh = ((q - self.start) / SLIP_WAY).tanh();
        let slope = self.most / SLIP_WAY * (1.0 - tanh * tanh);
        let bend = -2.0 * slope * tanh / SLIP_WAY;
        [
            q + self.most * tanh,
            dq * (1.0 + slope),
            ddq * (1.0 + slope) + bend * dq * dq,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_a_robot_do_not_depend_on_the_run_and_those_of_a_run_do() {
        let errors = PlantedErrors::uncalibrated(3);
        assert_eq!(errors.check_settings(), Ok(()));
        assert_eq!(errors.arm_mounts(1), errors.arm_mounts(2));
        assert_eq!(errors.joints(1), errors.joints(2));
        assert_eq!(errors.each_camera(1), errors.each_camera(2));
        let other = PlantedErrors::uncalibrated(4);
        assert_ne!(errors.joints(1), other.joints(1));
        let mut of_the_run = errors;
        of_the_run.robot = None;
        assert_ne!(of_the_run.joints(1), of_the_run.joints(2));
        assert_eq!(PlantedErrors::default().joints(1), None);
    }

    #[test]
    fn errors_stay_within_their_sizes() {
        for robot in 0..50 {
            let errors = PlantedErrors::uncalibrated(robot);
            let joints = errors.joints(0).unwrap();
            for own in joint::ARM {
                let mut offsets = joints.offsets[own.clone()].iter();
                assert!(offsets.all(|x| x.abs() <= errors.arm_offset));
                assert!(joints.compliances[own].iter().all(|x| {
                    (0.5 * errors.arm_compliance..=1.5 * errors.arm_compliance).contains(x)
                }));
            }
            for camera in errors.each_camera(0) {
                assert!((camera.shift.norm() - errors.each_camera_mount).abs() < 1e-12);
                assert!(camera.focal.abs() <= errors.focal);
            }
            let [camera, imu] = errors.clocks(0).map(|delay| delay.of(0));
            assert!(camera <= 6_000_000 && imu <= 4_000_000);
        }
    }

    #[test]
    fn slip_grows_with_the_way_up_to_its_greatest() {
        let slip = Slip {
            start: 0.1,
            most: 0.006,
        };
        assert_eq!(slip.at(0.1), 0.0);
        assert!(slip.at(0.2) > 0.003 && slip.at(0.2) < slip.at(0.3));
        assert!(slip.at(0.5) <= 0.006);
        assert!((slip.at(0.0) + slip.at(0.2)).abs() < 1e-15);
    }

    #[test]
    fn slips_velocity_and_acceleration_are_derivatives() {
        let slip = Slip {
            start: 0.0,
            most: -0.005,
        };
        let at = |t: f64| slip.apply([0.3 * t + 2.0 * t * t, 0.3 + 4.0 * t, 4.0]);
        let h = 1e-5;
        let (before, now, after) = (at(0.1 - h), at(0.1), at(0.1 + h));
        // Central differences: h^2 and rounding errors of 1e-16 / h.
        assert!(((after[0] - before[0]) / (2.0 * h) - now[1]).abs() < 1e-8);
        assert!(((after[1] - before[1]) / (2.0 * h) - now[2]).abs() < 1e-6);
    }
}
