//! The whole motion of a throw: to where the swing begins, a rest, the swing.

use tactnet_catching_packets::{JOINTS, THROW_JOINTS};

use super::swing::{ThrowJoints, throw_joint};
use super::way::{Way, touching};
use crate::ramp::Ramp;
use crate::robot::Robot;
use crate::safety::Bodies;

/// The robot stands so long before the swing, s: the torso swings on its springs.
const REST: f64 = 2.0;

/// Joints over time, s from its begin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowMotion {
    way: Way,
    swing: [Ramp; JOINTS],
    /// From the swing's begin to the release, and to its end, s.
    lets_go: f64,
    stands: f64,
}

impl ThrowMotion {
    /// Returns the motion from rest at `from` if all bodies stay `margin` m apart on it.
    ///
    /// - `posture`: of all joints that do not throw
    /// - `ends`: where the joints that throw swing from and to
    /// - `time`, `coast`: in which they speed up; for how long they keep their speeds before and after the release, s
    /// - `pace`: of the way to the swing, share of the greatest speeds
    ///
    /// # Errors
    /// With the pair of bodies that comes too near.
    pub(super) fn free(
        robot: &Robot,
        bodies: &Bodies,
        arm: usize,
        [from, posture]: [&[f64; JOINTS]; 2],
        ends: [ThrowJoints; 2],
        [time, coast, margin]: [f64; 3],
        pace: f64,
    ) -> Result<Self, usize> {
        let mut begin = *posture;
        let mut swing = posture.map(Ramp::standing);
        let stands = 2.0 * (time + coast);
        for i in 0..THROW_JOINTS {
            let (q0, q1) = (ends[0][i], ends[1][i]);
            begin[throw_joint(arm, i)] = q0;
            swing[throw_joint(arm, i)] = Ramp {
                q0,
                w0: 0.0,
                a: (q1 - q0) / (time + 2.0 * coast) / time,
                t1: time,
                t2: time + 2.0 * coast,
                end: stands,
            };
        }
        let swings = |t: f64| swing.map(|ramp| ramp.at(t).0);
        if let Some(pair) = touching(bodies, margin, stands, swings) {
            return Err(pair);
        }
        let over = robot.waiting();
        Ok(Self {
            way: Way::free(robot, bodies, [from, &begin], &over, [margin, pace])?,
            swing,
            lets_go: time + coast,
            stands,
        })
    }

    /// Returns when the swing begins, s.
    pub fn swing_begin(&self) -> f64 {
        self.way.end() + REST
    }

    /// Returns when fingers are to let go, s.
    pub fn release(&self) -> f64 {
        self.swing_begin() + self.lets_go
    }

    /// Returns when the robot stands again, s.
    pub fn end(&self) -> f64 {
        self.swing_begin() + self.stands
    }

    /// Returns the way to the swing, if it is straight, and the swing.
    pub(super) fn legs(&self) -> Option<[&[Ramp; JOINTS]; 2]> {
        Some([self.way.straight()?, &self.swing])
    }

    /// Returns positions and velocities of all joints at a time.
    pub fn at(&self, t: f64) -> ([f64; JOINTS], [f64; JOINTS]) {
        if t < self.swing_begin() {
            return self.way.at(t);
        }
        let all = self.swing.map(|ramp| ramp.at(t - self.swing_begin()));
        (all.map(|(q, _)| q), all.map(|(_, w)| w))
    }
}
