//! Result of a calibration.

use std::slice::from_mut;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, RobotDescription};

use super::unknowns::{UNKNOWNS, Unknowns, at};
use crate::track::CAMERAS;

/// Deviations of a robot from its description.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeckCalibration {
    /// Link angle minus sensor angle of pan and tilt, in rad.
    pub offsets: [f64; 2],
}

/// Deviations of the IMU from its description.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
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
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
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
        let mut found = Self::default();
        for (first, values) in found.slices() {
            values.copy_from_slice(&x.as_slice()[first..first + values.len()]);
        }
        found
    }

    /// Returns the values of all unknowns.
    pub fn unknowns(&self) -> Unknowns {
        let mut x = Unknowns::zeros(UNKNOWNS);
        for (first, values) in self.clone().slices() {
            x.as_mut_slice()[first..first + values.len()].copy_from_slice(values);
        }
        x
    }

    /// Returns all parameters with the indices of their first unknowns.
    fn slices(&mut self) -> Vec<(usize, &mut [f64])> {
        let (clocks, imu) = (&mut self.clocks, &mut self.imu);
        let mut all: Vec<(usize, &mut [f64])> = vec![
            (at::NECK, &mut self.neck.offsets),
            (at::IMU_TURN, &mut imu.turn),
            (at::ACCELEROMETER_BIAS, &mut imu.accelerometer_bias),
            (at::GYROSCOPE_BIAS, &mut imu.gyroscope_bias),
            (at::CAMERA_JOINTS, from_mut(&mut clocks.camera_joints)),
            (at::CAMERA_IMU, from_mut(&mut clocks.camera_imu)),
        ];
        for (camera, own) in self.cameras.iter_mut().enumerate() {
            let first = at::camera(camera);
            all.push((first, from_mut(&mut own.focal)));
            all.push((first + at::CENTRE, &mut own.centre));
            all.push((first + at::DISTORTION, &mut own.distortion));
            all.push((first + at::TURN, &mut own.turn));
            all.push((first + at::SHIFT, &mut own.shift));
        }
        for (arm, own) in self.arms.iter_mut().enumerate() {
            all.push((at::offsets(arm), &mut own.offsets));
            all.push((at::compliances(arm), &mut own.compliances));
            all.push((at::mount(arm), &mut own.mount));
            all.push((at::lengths(arm), &mut own.lengths));
            all.push((at::marker(arm), &mut own.marker));
        }
        all
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
