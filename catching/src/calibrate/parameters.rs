//! Result of a calibration.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, RobotDescription};

use super::unknowns::{UNKNOWNS, Unknowns, at};
use crate::track::CAMERAS;

/// Deviations of a robot from its description.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Cameras: left, right.
    pub cameras: [CameraCalibration; CAMERAS],
    /// Arms: left, right.
    pub arms: [ArmCalibration; ARMS],
    /// Neck.
    pub neck: NeckCalibration,
    /// Inertial measurement unit.
    pub imu: ImuCalibration,
    /// Clock offsets.
    pub clocks: ClockCalibration,
}

/// Deviations of a camera from its description.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraCalibration {
    /// Focal length minus the described one, in pixels.
    pub focal: f64,
    /// Principal point minus the centre of the picture, in pixels.
    pub centre: [f64; 2],
    /// Distortion k1 and k2 that remains after the described one is removed.
    pub distortion: [f64; 2],
    /// Rotation vector from the camera frame to the head frame, in rad.
    pub turn: [f64; 3],
    /// Position minus the described one, in the head frame, in m.
    pub shift: [f64; 3],
}

/// Deviations of an arm from its description.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArmCalibration {
    /// Link angle minus sensor angle without load, in rad.
    pub offsets: [f64; ARM_JOINTS],
    /// Joint compliances, in rad/Nm.
    pub compliances: [f64; ARM_JOINTS],
    /// Mounting position minus the described one, in the chest frame, in m.
    pub mount: [f64; 3],
    /// Lengths shoulder to elbow and elbow to wrist minus the described ones, in m.
    pub lengths: [f64; 2],
    /// Marker position in the frame of the last link, in m.
    pub marker: [f64; 3],
}

/// Deviations of the neck from its description.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeckCalibration {
    /// Link angle minus sensor angle of pan and tilt, in rad.
    pub offsets: [f64; 2],
}

/// Deviations of the IMU from its description.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuCalibration {
    /// Rotation vector from the IMU frame to the head frame, in rad.
    pub turn: [f64; 3],
    /// Accelerometer bias in the IMU frame, in m/s^2.
    pub accelerometer_bias: [f64; 3],
    /// Gyroscope bias in the IMU frame, in rad/s.
    pub gyroscope_bias: [f64; 3],
}

/// Delays of time stamps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockCalibration {
    /// Picture time stamp minus joint time stamp of the same moment, in s.
    pub camera_joints: f64,
    /// Picture time stamp minus IMU time stamp of the same moment, in s.
    pub camera_imu: f64,
}

impl Calibration {
    /// Converts a solution to parameters.
    ///
    /// # Panics
    /// Panics unless there are [`UNKNOWNS`] values.
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

    /// Returns a description with the calibrated positions of cameras and arms, arm lengths, and joint ranges in link
    /// angles. [`super::Corrections`] applies the remaining parameters to measurements and commands.
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
