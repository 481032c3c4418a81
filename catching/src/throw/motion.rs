//! Whole motion of a throw: approach to the swing, rest, swing.

use tactnet_catching_packets::{JOINTS, THROW_JOINTS};

use super::swing::{ThrowJoints, throw_joint};
use super::way::{Way, touching};
use crate::ramp::Ramp;
use crate::robot::Robot;
use crate::safety::Bodies;

/// Duration of the rest before the swing, in s. The torso's oscillation decays meanwhile.
const REST: f64 = 2.0;

/// Joint motion over time, in s from its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowMotion {
    way: Way,
    swing: [Ramp; JOINTS],
    /// Time from the start of the swing to the release, in s.
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

    /// Returns the start of the swing, in s.
    pub fn swing_begin(&self) -> f64 {
        self.way.end() + REST
    }

    /// Returns the release time, in s.
    pub fn release(&self) -> f64 {
        self.swing_begin() + self.lets_go
    }

    /// Returns the end of the motion, in s.
    pub fn end(&self) -> f64 {
        self.swing_begin() + self.stands
    }

    /// Returns the ramps of the approach and the swing, or `None` if the approach is not straight.
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
