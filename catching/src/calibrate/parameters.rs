//! The result of a calibration.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, RobotDescription};

use super::unknowns::{UNKNOWNS, Unknowns, at};
use crate::track::CAMERAS;

/// What a robot has that its description lacks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Left, right.
    pub cameras: [CameraCalibration; CAMERAS],
    /// Left, right.
    pub arms: [ArmCalibration; ARMS],
    /// Neck.
    pub neck: NeckCalibration,
    /// Inertial unit.
    pub imu: ImuCalibration,
    /// Stamps.
    pub clocks: ClockCalibration,
}

/// A camera beside the described one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraCalibration {
    /// Focal length less the described one, pixels.
    pub focal: f64,
    /// Optical axis less the middle of the picture, pixels.
    pub centre: [f64; 2],
    /// What is left of the distortion after the described one is taken out: k1, k2.
    pub distortion: [f64; 2],
    /// Rotation vector from its directions to the head's, rad.
    pub turn: [f64; 3],
    /// From where it is described to where it is, m, head's frame.
    pub shift: [f64; 3],
}

/// An arm beside the described one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmCalibration {
    /// Link less sensor without load, rad.
    pub offsets: [f64; ARM_JOINTS],
    /// rad/Nm.
    pub compliances: [f64; ARM_JOINTS],
    /// From where it is described to where it is mounted, m, chest's frame.
    pub mount: [f64; 3],
    /// Shoulder to elbow and elbow to wrist less the described lengths, m.
    pub lengths: [f64; 2],
    /// The marker in the frame of its last link, m.
    pub marker: [f64; 3],
}

/// The neck beside the described one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeckCalibration {
    /// Pan, tilt: link less sensor, rad.
    pub offsets: [f64; 2],
}

/// The inertial unit beside the described one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuCalibration {
    /// Rotation vector from its directions to the head's, rad.
    pub turn: [f64; 3],
    /// m/s^2, its own directions.
    pub accelerometer_bias: [f64; 3],
    /// rad/s, its own directions.
    pub gyroscope_bias: [f64; 3],
}

/// By how much stamps are late.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockCalibration {
    /// Pictures' stamps less those of joints, s.
    pub camera_joints: f64,
    /// Pictures' stamps less those of the inertial unit, s.
    pub camera_imu: f64,
}

impl Calibration {
    /// Returns the parameters of a solution.
    ///
    /// # Panics
    /// Unless there are [`UNKNOWNS`] of them.
    pub fn of(x: &Unknowns) -> Self {
        assert_eq!(x.len(), UNKNOWNS, "unknowns");
        fn array<const N: usize>(x: &Unknowns, first: usize) -> [f64; N] {
            std::array::from_fn(|i| x[first + i])
        }
        Self {
            cameras: std::array::from_fn(|camera| {
                let own = at::camera(camera);
                CameraCalibration {
                    focal: x[own],
                    centre: array(x, own + at::CENTRE),
                    distortion: array(x, own + at::DISTORTION),
                    turn: array(x, own + at::TURN),
                    shift: array(x, own + at::SHIFT),
                }
            }),
            arms: std::array::from_fn(|arm| ArmCalibration {
                offsets: array(x, at::offsets(arm)),
                compliances: array(x, at::compliances(arm)),
                mount: array(x, at::mount(arm)),
                lengths: array(x, at::lengths(arm)),
                marker: array(x, at::marker(arm)),
            }),
            neck: NeckCalibration {
                offsets: array(x, at::NECK),
            },
            imu: ImuCalibration {
                turn: array(x, at::IMU_TURN),
                accelerometer_bias: array(x, at::ACCELEROMETER_BIAS),
                gyroscope_bias: array(x, at::GYROSCOPE_BIAS),
            },
            clocks: ClockCalibration {
                camera_joints: x[at::CAMERA_JOINTS],
                camera_imu: x[at::CAMERA_IMU],
            },
        }
    }

    /// Returns the values of all unknowns.
    pub fn unknowns(&self) -> Unknowns {
        let mut x = Unknowns::zeros(UNKNOWNS);
        let mut put = |first: usize, values: &[f64]| {
            x.as_mut_slice()[first..first + values.len()].copy_from_slice(values);
        };
        for (camera, own) in self.cameras.iter().enumerate() {
            let first = at::camera(camera);
            put(first, &[own.focal]);
            put(first + at::CENTRE, &own.centre);
            put(first + at::DISTORTION, &own.distortion);
            put(first + at::TURN, &own.turn);
            put(first + at::SHIFT, &own.shift);
        }
        for (arm, own) in self.arms.iter().enumerate() {
            put(at::offsets(arm), &own.offsets);
            put(at::compliances(arm), &own.compliances);
            put(at::mount(arm), &own.mount);
            put(at::lengths(arm), &own.lengths);
            put(at::marker(arm), &own.marker);
        }
        put(at::NECK, &self.neck.offsets);
        put(at::IMU_TURN, &self.imu.turn);
        put(at::ACCELEROMETER_BIAS, &self.imu.accelerometer_bias);
        put(at::GYROSCOPE_BIAS, &self.imu.gyroscope_bias);
        put(
            at::CAMERA_JOINTS,
            &[self.clocks.camera_joints, self.clocks.camera_imu],
        );
        x
    }

    /// Returns the description with cameras and arms where they are, arms as long as they are, and ranges of links instead of sensors. What cannot be described so, [`super::Corrections`] take out of measurements
    /// and put into commands.
    pub fn describe(&self, description: &RobotDescription) -> RobotDescription {
        let mut described = description.clone();
        for (shift, camera) in described.cameras.shifts.iter_mut().zip(&self.cameras) {
            *shift = (Vector3::from(*shift) + Vector3::from(camera.shift)).into();
        }
        for (arm, own) in described.arms.iter_mut().zip(&self.arms) {
            arm.position = (Vector3::from(arm.position) + Vector3::from(own.mount)).into();
            arm.shoulder_to_elbow += own.lengths[0];
            arm.elbow_to_wrist += own.lengths[1];
            for (joint, offset) in arm.joints.iter_mut().zip(own.offsets) {
                joint.range = joint.range.map(|end| end + offset);
            }
        }
        let neck = described.neck.joints.iter_mut();
        for (joint, offset) in neck.zip(self.neck.offsets) {
            joint.range = joint.range.map(|end| end + offset);
        }
        described
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn parameters_are_all_unknowns(values in proptest::collection::vec(-1.0..1.0f64, UNKNOWNS)) {
            let x = Unknowns::from_vec(values);
            prop_assert_eq!(Calibration::of(&x).unknowns(), x);
        }
    }
}
