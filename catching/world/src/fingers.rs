//! Fingers and palm of a hand: geometry and motors.
//!
//! Four fingers stand around a palm disc, as a basket that opens along the hand's axis (thesis, figure 3.3). A finger is
//! a chain of three phalanges (capsules) in a plane through the axis. One coordinate closes its three joints together;
//! its motor keeps a speed with a limited torque, so that a ball can push the finger back until its stop.
//!
//! Sources of the settings: [T] thesis, [O] assumed.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::error::{WorldError, from_to, not_negative, positive, probability};

/// Number of fingers of a hand.
pub(crate) const FINGERS: usize = 4;
/// Number of phalanges of a finger.
const PHALANGES: usize = 3;

tactnet_catching_packets::settings! {
    /// Settings of fingers and palm, and of their contact with a ball.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct FingersConfig in "fingers.": WorldError {
        /// Lengths of the phalanges from palm to tip, in m. Their sum is 14 cm [T 1.3.1], the parts are [O].
        pub phalanges: [f64; 3] = [0.06, 0.045, 0.035] => positive,
        /// Radius of the phalanges, in m [O].
        pub radius: f64 = 0.01 => positive,
        /// Distance of the finger bases from the hand's axis, in m [O].
        pub base: f64 = 0.055 => positive,
        /// Radius of the palm disc, in m [O].
        pub palm: f64 = 0.05 => positive,
        /// Distance of the open finger tips' surfaces from the axis, in m: radius of the ball and the 2 cm of [T 3.1] [O].
        pub opening: f64 = 0.0625 => positive,
        /// Height of the open finger tips above the catch frame, in m [O, as the fingers that touch obstacles].
        pub height: f64 = 0.04 => from_to([-0.2, 0.2], "a number from -0.2 to 0.2"),
        /// Rotation of the first joint until the tips meet, in rad [O].
        pub travel: f64 = 0.227 => positive,
        /// Rotation of the second and the third joint per rotation of the first [O].
        pub curl: [f64; 2] = [1.0, 1.0] => not_negative,
        /// Speed of the first joint, in rad/s: 550 deg/s [T 1.3.1].
        pub speed: f64 = 9.6 => positive,
        /// Force of a finger tip, in N [T 1.3.1].
        pub force: f64 = 20.0 => positive,
        /// Moved mass of finger and motor, as seen at the tip, in kg [O].
        pub mass: f64 = 0.05 => positive,
        /// Ratio of the normal speeds after and before a contact of the ball [O, as on the floor].
        pub restitution: f64 = 0.7 => probability,
        /// Coefficient of friction between ball and hand [O].
        pub friction: f64 = 0.5 => not_negative,
        /// Time from the start of closing to the commanded catch time, in s [O, as `CLOSING_NS`].
        pub lead: f64 = 0.01 => from_to([-0.1, 0.1], "a number from -0.1 to 0.1"),
        /// Time inside the closing fingers after which a ball counts as caged, in s [O].
        pub hold: f64 = 0.15 => positive,
    }
}

/// Shape and motor of a finger, derived from the settings.
#[derive(Debug, Clone)]
pub(crate) struct Basket {
    pub(crate) config: FingersConfig,
    /// Outward lean of the open fingers, in rad.
    lean: f64,
    /// Rotations of the phalanges per rotation of the first joint.
    gains: [f64; PHALANGES],
    /// Inertia of the closing coordinate, in kg m^2.
    pub(crate) inertia: f64,
    /// Largest acceleration of the closing coordinate by the motor, in rad/s^2.
    acceleration: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Fingers {
    /// Rotation of the first joints from the open pose, in rad.
    pub(crate) angles: [f64; FINGERS],
    /// Their speeds, in rad/s.
    pub(crate) rates: [f64; FINGERS],
    /// True from the start of closing until the hand opens.
    pub(crate) closing: bool,
}

pub(crate) struct FingerPoint {
    /// Point on the middle line, in m.
    pub(crate) point: Vector3<f64>,
    /// Its derivative by the closing coordinate, in m/rad.
    pub(crate) motion: Vector3<f64>,
}

impl Basket {
    pub(crate) fn new(config: &FingersConfig) -> Self {
        let length: f64 = config.phalanges.iter().sum();
        let out = (config.opening + config.radius - config.base) / length;
        let gains = [0.0, config.curl[0], config.curl[0] + config.curl[1]].map(|more| 1.0 + more);
        let arm: f64 = config.phalanges.iter().zip(gains).map(|(l, w)| l * w).sum();
        Self {
            config: config.clone(),
            lean: out.clamp(-1.0, 1.0).asin(),
            gains,
            inertia: config.mass * arm * arm,
            acceleration: config.force / (config.mass * arm),
        }
    }

    /// Returns the height of the palm above the catch frame, in m.
    pub(crate) fn palm_height(&self) -> f64 {
        self.config.height - self.config.phalanges.iter().sum::<f64>() * self.lean.cos()
    }

    /// Returns base, joints and tip of a finger in the catch frame, in m, each with its derivative by the closing
    /// coordinate.
    pub(crate) fn chain(&self, finger: usize, angle: f64) -> [FingerPoint; PHALANGES + 1] {
        let (sin, cos) = (FRAC_PI_2 * finger as f64).sin_cos();
        let spatial = |out: f64, up: f64| Vector3::new(out * cos, out * sin, up);
        let (mut at, mut by) = ([self.config.base, self.palm_height()], [0.0; 2]);
        std::array::from_fn(|node| {
            if let Some(i) = node.checked_sub(1) {
                let (sin, cos) = (self.gains[i] * angle - self.lean).sin_cos();
                let (length, turn) = (self.config.phalanges[i], self.gains[i]);
                at = [at[0] - length * sin, at[1] + length * cos];
                by = [by[0] - length * turn * cos, by[1] - length * turn * sin];
            }
            FingerPoint {
                point: spatial(at[0], at[1]),
                motion: spatial(by[0], by[1]),
            }
        })
    }

    /// Returns the height of the finger tips above the catch frame, in m (mean).
    pub(crate) fn tips_height(&self, fingers: &Fingers) -> f64 {
        let chains = (0..FINGERS).map(|finger| self.chain(finger, fingers.angles[finger]));
        chains.map(|chain| chain[PHALANGES].point.z).sum::<f64>() / FINGERS as f64
    }

    /// Returns true if a push of the closing coordinate in this direction meets a stop.
    pub(crate) fn is_blocked(&self, angle: f64, push: f64) -> bool {
        (angle <= 0.0 && push < 0.0) || (angle >= self.config.travel && push > 0.0)
    }

    /// Lets the motors act for `h` seconds.
    pub(crate) fn drive(&self, fingers: &mut Fingers, h: f64) {
        let direction = if fingers.closing { 1.0 } else { -1.0 };
        for (angle, rate) in fingers.angles.iter().zip(&mut fingers.rates) {
            let wanted = match self.is_blocked(*angle, direction) {
                true => 0.0,
                false => direction * self.config.speed,
            };
            let most = self.acceleration * h;
            *rate += (wanted - *rate).clamp(-most, most);
        }
    }

    /// Moves the fingers for `h` seconds, up to their stops.
    pub(crate) fn turn(&self, fingers: &mut Fingers, h: f64) {
        for (angle, rate) in fingers.angles.iter_mut().zip(&mut fingers.rates) {
            let next = *angle + *rate * h;
            *angle = next.clamp(0.0, self.config.travel);
            if *angle != next {
                *rate = 0.0;
            }
        }
    }
}

/// Returns the point of a phalanx that is nearest to a place.
pub(crate) fn nearest(ends: &[FingerPoint], place: &Vector3<f64>) -> FingerPoint {
    let (from, along) = (&ends[0], ends[1].point - ends[0].point);
    let share = ((place - from.point).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
    FingerPoint {
        point: from.point + along * share,
        motion: from.motion * (1.0 - share) + ends[1].motion * share,
    }
}
