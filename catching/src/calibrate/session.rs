//! What a calibration session recorded.

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;

use super::error::CalibrationError;
use crate::track::CAMERAS;

/// Pan and tilt by their sensors, at a stamp.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NeckMotion {
    /// rad.
    pub q: [f64; 2],
    /// rad/s.
    pub dq: [f64; 2],
    /// rad/s^2.
    pub ddq: [f64; 2],
}

impl NeckMotion {
    /// Returns a neck that stands.
    pub fn standing(q: [f64; 2]) -> Self {
        Self {
            q,
            dq: [0.0; 2],
            ddq: [0.0; 2],
        }
    }

    /// Returns the motion `late` s before the stamp.
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

/// A marker in a pair of pictures, while the arm stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Picture {
    /// Number of the arm's configuration.
    pub configuration: usize,
    /// 0 left, 1 right.
    pub arm: usize,
    /// Where the marker was found in the left and the right picture, pixels; the described lens's distortion is taken out.
    pub features: [Option<[f64; 2]>; CAMERAS],
    /// The arm's joints by their sensors, rad.
    pub q: [f64; ARM_JOINTS],
    /// Torques with which the arm's load turns its joints, Nm: what sensors say that drives carry, the other way; the mean of the
    /// configuration.
    pub loads: [f64; ARM_JOINTS],
    /// The neck at the picture's stamp.
    pub neck: NeckMotion,
}

/// The inertial unit while the head stands still: means.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rest {
    /// Pan and tilt by their sensors, rad.
    pub neck: [f64; 2],
    /// Specific force, m/s^2.
    pub acceleration: [f64; 3],
    /// Rotation, rad/s.
    pub rate: [f64; 3],
    /// Samples that the means are of.
    pub samples: usize,
}

/// The inertial unit while the head turns and the arms stand.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// The neck at the sample's stamp.
    pub neck: NeckMotion,
    /// Rotation, rad/s.
    pub rate: [f64; 3],
}

/// A calibration session.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Markers before the cameras.
    pub pictures: Vec<Picture>,
    /// The head at rest.
    pub rests: Vec<Rest>,
    /// The head in motion.
    pub turns: Vec<Turn>,
    /// Time that the robot needs for it at its joints' speeds, s.
    pub robot_seconds: f64,
}

impl Session {
    /// Returns how many configurations of an arm were seen by both cameras, not necessarily in the same pictures.
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

    /// Looks for what no solver can mend.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub(crate) fn check(&self, configurations: usize) -> Result<(), CalibrationError> {
        self.check_numbers()?;
        for arm in 0..2 {
            for (camera, name) in ["left", "right"].into_iter().enumerate() {
                let features = self
                    .pictures
                    .iter()
                    .filter(|picture| picture.arm == arm && picture.features[camera].is_some())
                    .count();
                if features == 0 {
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
        let mut disparities: Vec<f64> = self
            .pictures
            .iter()
            .filter_map(|picture| {
                let [left, right] = picture.features;
                Some(left?[0] - right?[0])
            })
            .collect();
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
            finite(
                "turn",
                number,
                turn.rate.into_iter().chain(neck(&turn.neck)),
            )?;
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
