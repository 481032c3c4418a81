//! Whole motion of a throw: approach to the swing, rest, swing.

use tactnet_catching_packets::{JOINTS, THROW_JOINTS};

use super::swing::{ThrowJoints, throw_joint};
use super::way::{Way, WayRequest, touching};
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
    release_after: f64,
    /// Time from the start to the end of the swing, in s.
    swing_duration: f64,
}

/// Request of a throw's motion.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionRequest<'a> {
    /// Throwing arm: 0 left, 1 right.
    pub arm: usize,
    /// Current positions of all joints, at rest.
    pub from: &'a [f64; JOINTS],
    /// Positions of the joints that do not throw, during the swing.
    pub posture: &'a [f64; JOINTS],
    /// Start and end of the swing.
    pub ends: [ThrowJoints; 2],
    /// Acceleration time, in s.
    pub time: f64,
    /// Time for which joints keep their velocities before and after the release, in s.
    pub coast: f64,
    /// Minimum distance of all bodies, in m.
    pub margin: f64,
    /// Fraction of the maximum speeds used in the approach.
    pub pace: f64,
}

impl ThrowMotion {
    /// Returns the motion if all bodies keep the margin.
    ///
    /// # Errors
    /// Returns the pair of bodies that comes too close.
    pub(super) fn free(
        robot: &Robot,
        bodies: &Bodies,
        request: &MotionRequest<'_>,
    ) -> Result<Self, usize> {
        let MotionRequest {
            arm,
            from,
            posture,
            ends,
            time,
            coast,
            margin,
            pace,
        } = *request;
        let mut begin = *posture;
        let mut swing = posture.map(Ramp::standing);
        let swing_duration = 2.0 * (time + coast);
        for i in 0..THROW_JOINTS {
            let (q0, q1) = (ends[0][i], ends[1][i]);
            begin[throw_joint(arm, i)] = q0;
            swing[throw_joint(arm, i)] = Ramp {
                q0,
                w0: 0.0,
                a: (q1 - q0) / (time + 2.0 * coast) / time,
                t1: time,
                t2: time + 2.0 * coast,
                end: swing_duration,
            };
        }
        let swings = |t: f64| swing.map(|ramp| ramp.at(t).0);
        if let Some(pair) = touching(bodies, margin, swing_duration, swings) {
            return Err(pair);
        }
        let over = robot.waiting();
        Ok(Self {
            way: Way::free(
                robot,
                bodies,
                &WayRequest {
                    from,
                    to: &begin,
                    over: &over,
                    margin,
                    pace,
                },
            )?,
            swing,
            release_after: time + coast,
            swing_duration,
        })
    }

    /// Returns the start of the swing, in s.
    pub fn swing_begin(&self) -> f64 {
        self.way.end() + REST
    }

    /// Returns the release time, in s.
    pub fn release(&self) -> f64 {
        self.swing_begin() + self.release_after
    }

    /// Returns the end of the motion, in s.
    pub fn end(&self) -> f64 {
        self.swing_begin() + self.swing_duration
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
