//! Motion of an arm to a catch: one ramp per joint from the current state to rest.

use tactnet_catching_packets::{ARM_JOINTS, Joint};

use super::passing::Passing;
use crate::ramp::{Acceleration, LeastTime, Ramp};
use crate::robot::ArmKinematics;

/// Number of unknowns: joint angles and catch time.
pub const UNKNOWNS: usize = ARM_JOINTS + 1;
/// Values of the unknowns: `q` and `t`.
pub(crate) type Point = [f64; UNKNOWNS];

/// Motion of the other arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OtherArm {
    /// Ramps of its joints.
    pub ramps: [Ramp; ARM_JOINTS],
    /// Time from the start of these ramps to the start of the planned motion, in s.
    pub since: f64,
}

impl OtherArm {
    /// Returns an arm at rest.
    pub fn standing(q: &[f64; ARM_JOINTS]) -> Self {
        Self {
            ramps: q.map(Ramp::standing),
            since: 0.0,
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        let is_sound = |ramp: &Ramp| ramp.is_finite() && ramp.end >= 0.0;
        self.since.is_finite() && self.ramps.iter().all(is_sound)
    }
}

/// Motion of an arm as a function of the unknowns.
pub(crate) struct CatchMotion<'a> {
    pub arm: &'a ArmKinematics,
    pub joints: &'a [Joint; ARM_JOINTS],
    /// Joint angles at the start, in rad.
    pub q0: [f64; ARM_JOINTS],
    /// Joint velocities at the start, in rad/s.
    pub w0: [f64; ARM_JOINTS],
    /// Earliest end, in s.
    pub earliest: f64,
    /// If true, the ramps end when the slowest joint can arrive, otherwise at the catch.
    pub arrives_early: bool,
    /// Motion of the other arm; `None` if it rests in its waiting pose.
    pub other: Option<OtherArm>,
}

impl CatchMotion<'_> {
    /// Returns the ramps to a point.
    pub fn ramps(&self, x: &Point) -> [Ramp; ARM_JOINTS] {
        let mut end = x[ARM_JOINTS];
        if self.arrives_early {
            let least = (0..ARM_JOINTS)
                .map(|i| LeastTime::exact(x[i] - self.q0[i], self.w0[i], &self.joints[i]).t);
            end = least.fold(self.earliest, f64::max).min(end);
        }
        std::array::from_fn(|i| {
            Ramp::between(self.q0[i], self.w0[i], x[i], end, self.joints[i].speed)
        })
    }

    /// Returns the largest distance of the ramps to a point beyond the joints' ranges, in rad, negative within them.
    pub fn beyond_ranges(&self, x: &Point) -> f64 {
        let beyond = |(ramp, joint): (Ramp, &Joint)| {
            let [low, high] = ramp.extent();
            (joint.range[0] - low).max(high - joint.range[1])
        };
        let ramps = self.ramps(x).into_iter().zip(self.joints);
        ramps.map(beyond).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Returns the acceleration of joint `i` for a motion to a point that ends at the catch.
    pub fn acceleration(&self, x: &Point, i: usize) -> Acceleration {
        let (d, w0) = (x[i] - self.q0[i], self.w0[i]);
        Acceleration::new(d, x[ARM_JOINTS], w0, self.joints[i].speed)
    }

    /// Returns the end of the ramps to a point, in s, and its derivatives.
    pub fn end(&self, x: &Point) -> (f64, [f64; UNKNOWNS]) {
        let mut by = [0.0; UNKNOWNS];
        let t = x[ARM_JOINTS];
        by[ARM_JOINTS] = 1.0;
        if !self.arrives_early {
            return (t, by);
        }
        let mut end = (self.earliest, [0.0; UNKNOWNS]);
        for i in 0..ARM_JOINTS {
            let least = LeastTime::exact(x[i] - self.q0[i], self.w0[i], &self.joints[i]);
            if least.t > end.0 {
                let mut by = [0.0; UNKNOWNS];
                by[i] = least.by_distance;
                end = (least.t, by);
            }
        }
        if end.0 > t { (t, by) } else { end }
    }

    /// Returns the joints after a fraction `share` of the motion to a point that lasts `end` seconds.
    pub fn passing(&self, x: &Point, end: f64, share: f64) -> [Passing; ARM_JOINTS] {
        std::array::from_fn(|i| {
            let (q0, w0) = (self.q0[i], self.w0[i]);
            Passing::new(q0, w0, x[i] - q0, end, self.joints[i].speed, share)
        })
    }
}
