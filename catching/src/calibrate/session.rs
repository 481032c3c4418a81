//! Recorded data of a calibration session.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, JOINTS, joint};

use super::error::CalibrationError;
use crate::track::CAMERAS;

/// Measured motion of pan and tilt at a time stamp.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeckMotion {
    /// Positions, in rad.
    pub q: [f64; 2],
    /// Velocities, in rad/s.
    pub dq: [f64; 2],
    /// Accelerations, in rad/s^2.
    pub ddq: [f64; 2],
}

impl NeckMotion {
    /// Returns a neck at rest.
    pub fn standing(q: [f64; 2]) -> Self {
        Self {
            q,
            dq: [0.0; 2],
            ddq: [0.0; 2],
        }
    }

    /// Returns pan and tilt of values for all joints.
    pub(crate) fn of(joints: &[f64; JOINTS]) -> [f64; 2] {
        std::array::from_fn(|i| joints[joint::NECK.start + i])
    }

    /// Extrapolates the motion to `late` s before the time stamp.
    pub(crate) fn before(&self, late: f64) -> Self {
        let back = |i: usize| self.q[i] - late * (self.dq[i] - late / 2.0 * self.ddq[i]);
        let rate = |i: usize| self.dq[i] - late * self.ddq[i];
        Self {
            q: [back(0), back(1)],
            dq: [rate(0), rate(1)],
            ddq: self.ddq,
        }
    }
}

/// Marker in a pair of pictures while the arm is at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// Index of the arm's configuration.
    pub configuration: usize,
    /// Arm: 0 left, 1 right.
    pub arm: usize,
    /// Marker position in the left and the right picture, in pixels, with the described lens distortion removed.
    pub features: [Option<[f64; 2]>; CAMERAS],
    /// Measured joint angles of the arm, in rad.
    pub q: [f64; ARM_JOINTS],
    /// Load torques about the arm's joints, in Nm, averaged over the configuration. They are the negatives of the
    /// measured drive torques.
    pub loads: [f64; ARM_JOINTS],
    /// Neck motion at the picture's time stamp.
    pub neck: NeckMotion,
}

impl Picture {
    /// Returns a picture without features, of no configuration.
    pub(crate) fn without_features(
        arm: usize,
        q: [f64; ARM_JOINTS],
        loads: [f64; ARM_JOINTS],
        neck: NeckMotion,
    ) -> Self {
        Self {
            configuration: 0,
            arm,
            features: [None; CAMERAS],
            q,
            loads,
            neck,
        }
    }
}

/// Mean of IMU samples while the head is at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rest {
    /// Measured pan and tilt, in rad.
    pub neck: [f64; 2],
    /// Specific force, in m/s^2.
    pub acceleration: [f64; 3],
    /// Angular velocity, in rad/s.
    pub rate: [f64; 3],
    /// Number of averaged samples.
    pub samples: usize,
}

/// IMU sample while the head turns and the arms are at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// Neck motion at the sample's time stamp.
    pub neck: NeckMotion,
    /// Angular velocity, in rad/s.
    pub rate: [f64; 3],
}

/// Calibration session.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Markers seen by the cameras.
    pub pictures: Vec<Picture>,
    /// IMU means with the head at rest.
    pub rests: Vec<Rest>,
    /// IMU samples with the head in motion.
    pub turns: Vec<Turn>,
    /// Duration of the robot's motion, in s.
    pub robot_seconds: f64,
}

impl Session {
    /// Returns the number of an arm's configurations that both cameras saw, not necessarily in the same pictures.
    pub fn configurations(&self, arm: usize) -> usize {
        let seen = |camera: usize| {
            self.pictures
                .iter()
                .filter(move |picture| picture.arm == arm && picture.features[camera].is_some())
                .map(|picture| picture.configuration)
                .collect::<std::collections::BTreeSet<usize>>()
        };
        seen(0).intersection(&seen(1)).count()
    }

    /// Checks that the session can determine a calibration.
    ///
    /// # Errors
    /// Returns the first problem found.
    pub(crate) fn check(&self, configurations: usize) -> Result<(), CalibrationError> {
        self.check_numbers()?;
        for arm in 0..2 {
            for (camera, name) in ["left", "right"].into_iter().enumerate() {
                let saw = |of: &Picture| of.arm == arm && of.features[camera].is_some();
                if !self.pictures.iter().any(saw) {
                    return Err(CalibrationError::NeverSeen {
                        arm,
                        camera: name,
                        expected: configurations,
                    });
                }
            }
            let found = self.configurations(arm);
            if found < configurations {
                return Err(CalibrationError::TooFew {
                    arm,
                    expected: configurations,
                    found,
                });
            }
        }
        let disparity = |picture: &Picture| {
            let [left, right] = picture.features;
            Some(left?[0] - right?[0])
        };
        let mut disparities: Vec<f64> = self.pictures.iter().filter_map(disparity).collect();
        disparities.sort_by(f64::total_cmp);
        match disparities.get(disparities.len() / 2) {
            Some(median) if *median < 0.0 => Err(CalibrationError::Exchanged { found: -median }),
            _ => Ok(()),
        }
    }

    fn check_numbers(&self) -> Result<(), CalibrationError> {
        let neck = |neck: &NeckMotion| [neck.q, neck.dq, neck.ddq].concat();
        for (number, picture) in self.pictures.iter().enumerate() {
            if picture.arm > 1 {
                return Err(CalibrationError::Arm {
                    number,
                    found: picture.arm,
                });
            }
            let features = picture.features.iter().flatten().flatten();
            let values = features.chain(&picture.q).chain(&picture.loads).copied();
            finite("picture", number, values.chain(neck(&picture.neck)))?;
        }
        for (number, rest) in self.rests.iter().enumerate() {
            let values = rest.neck.into_iter().chain(rest.acceleration);
            finite("rest", number, values.chain(rest.rate))?;
        }
        for (number, turn) in self.turns.iter().enumerate() {
            let values = turn.rate.into_iter().chain(neck(&turn.neck));
            finite("turn", number, values)?;
        }
        Ok(())
    }
}

fn finite(
    record: &'static str,
    number: usize,
    mut values: impl Iterator<Item = f64>,
) -> Result<(), CalibrationError> {
    match values.find(|value| !value.is_finite()) {
        Some(found) => Err(CalibrationError::NotFinite {
            record,
            number,
            found,
        }),
        None => Ok(()),
    }
}
