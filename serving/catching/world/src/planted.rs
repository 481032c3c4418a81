//! What the true robot has that its description lacks.

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, UnitSphere};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARMS;

use crate::error::{WorldError, not_negative};
use crate::stream::Stream;

/// Way of the platform after which its slip comes near its greatest, m; assumed.
const SLIP_WAY: f64 = 0.15;

/// Planted errors. Those of geometry have the given size and a direction drawn for the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlantedErrors {
    /// Greatest slip of the platform's wheels, m; each run's is drawn evenly up to it, either way.
    pub platform_slip: f64,
    /// Arms mounted this far from where the description says, m.
    pub arm_mount: f64,
    /// Cameras mounted this far off, m.
    pub camera_mount: f64,
    /// Cameras turned by this, rad.
    pub camera_turn: f64,
}

impl Default for PlantedErrors {
    fn default() -> Self {
        Self {
            platform_slip: 0.006,
            arm_mount: 0.0,
            camera_mount: 0.0,
            camera_turn: 0.0,
        }
    }
}

impl PlantedErrors {
    pub(crate) fn check(&self) -> Result<(), WorldError> {
        not_negative("errors.platform_slip", self.platform_slip)?;
        not_negative("errors.arm_mount", self.arm_mount)?;
        not_negative("errors.camera_mount", self.camera_mount)?;
        not_negative("errors.camera_turn", self.camera_turn)
    }

    /// Draws where the arms are mounted wrongly, m, chest's frame.
    pub(crate) fn arm_mounts(&self, seed: u64) -> [Vector3<f64>; ARMS] {
        std::array::from_fn(|arm| {
            let direction: [f64; 3] =
                UnitSphere.sample(&mut Stream::ArmMount.rng(seed, arm as u64));
            Vector3::from(direction) * self.arm_mount
        })
    }

    /// Draws how the cameras are mounted wrongly: moved, m, and turned, in the head's frame.
    pub(crate) fn camera_mount(&self, seed: u64) -> (Vector3<f64>, Matrix3<f64>) {
        let mut rng = Stream::CameraMount.rng(seed, 0);
        let direction: [f64; 3] = UnitSphere.sample(&mut rng);
        let axis: [f64; 3] = UnitSphere.sample(&mut rng);
        let axis = Unit::new_normalize(Vector3::from(axis));
        (
            Vector3::from(direction) * self.camera_mount,
            Rotation3::from_axis_angle(&axis, self.camera_turn).into_inner(),
        )
    }

    /// Draws the platform's slip; it starts at `start`, m.
    pub(crate) fn slip(&self, seed: u64, start: f64) -> Slip {
        let part = Stream::Slip.rng(seed, 0).random::<f64>() * 2.0 - 1.0;
        Slip {
            start,
            most: self.platform_slip * part,
        }
    }
}

/// Position, velocity and acceleration of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moving {
    pub(crate) q: f64,
    pub(crate) dq: f64,
    pub(crate) ddq: f64,
}

/// Wheels that slip: `s = most tanh(way / SLIP_WAY)`, so slip grows with the way and is smooth.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slip {
    start: f64,
    most: f64,
}

impl Slip {
    /// Returns the slip, m.
    pub(crate) fn at(&self, q: f64) -> f64 {
        self.most * ((q - self.start) / SLIP_WAY).tanh()
    }

    /// Returns how the platform really moves when its drive moves like `drive`.
    pub(crate) fn apply(&self, drive: Moving) -> Moving {
        let tanh = ((drive.q - self.start) / SLIP_WAY).tanh();
        let slope = self.most / SLIP_WAY * (1.0 - tanh * tanh);
        let bend = -2.0 * slope * tanh / SLIP_WAY;
        Moving {
            q: drive.q + self.most * tanh,
            dq: drive.dq * (1.0 + slope),
            ddq: drive.ddq * (1.0 + slope) + bend * drive.dq * drive.dq,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let at = |t: f64| {
            slip.apply(Moving {
                q: 0.3 * t + 2.0 * t * t,
                dq: 0.3 + 4.0 * t,
                ddq: 4.0,
            })
        };
        let h = 1e-5;
        let (before, now, after) = (at(0.1 - h), at(0.1), at(0.1 + h));
        // Central differences: h^2 and rounding 1e-16 / h.
        assert!(((after.q - before.q) / (2.0 * h) - now.dq).abs() < 1e-8);
        assert!(((after.dq - before.dq) / (2.0 * h) - now.ddq).abs() < 1e-6);
    }
}
