//! Whole motion of a throw: approach from the waiting pose to the swing, rest, swing.

use tactnet_catching_packets::{JOINTS, Joint, THROW_JOINTS};

use super::planner::ThrowPlanConfig;
use super::swing::{ThrowJoints, throw_joint};
use crate::ramp::{Ramp, together};
use crate::robot::Robot;
use crate::safety::{Bodies, PAIRS, distance};

/// Duration of the rest before the swing, in s. The torso's oscillation decays meanwhile.
const REST: f64 = 2.0;
/// Time between collision checks, in s.
const CHECK_PERIOD: f64 = 0.01;

/// Joint motion over time, in s from its start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThrowMotion {
    pub(super) way: [Ramp; JOINTS],
    pub(super) swing: [Ramp; JOINTS],
    /// Time from the start to the end of the approach, in s.
    way_duration: f64,
    /// Time from the start of the swing to the release, in s.
    release_after: f64,
}

impl ThrowMotion {
    /// Returns the motion of an arm (0 left, 1 right) if all bodies keep the margin.
    ///
    /// - `ends`: start and end of the swing
    /// - `time`: acceleration time, in s
    ///
    /// # Errors
    /// Returns the pair of bodies that comes too close.
    pub(super) fn free(
        robot: &Robot,
        bodies: &Bodies,
        config: &ThrowPlanConfig,
        arm: usize,
        ends: [ThrowJoints; 2],
        time: f64,
    ) -> Result<Self, usize> {
        let coast = config.coast;
        let waiting = robot.waiting();
        let mut begin = waiting;
        let mut swing = waiting.map(Ramp::standing);
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
        let gentle = robot.joints().map(|joint| Joint {
            speed: config.pace * joint.speed,
            acceleration: config.pace * config.pace * joint.acceleration,
            ..joint
        });
        let (way, way_duration) = together(&waiting, &begin, &gentle);
        for (ramps, end) in [(&swing, swing_duration), (&way, way_duration)] {
            let places = |t: f64| ramps.map(|ramp| ramp.at(t).0);
            if let Some(pair) = touching(bodies, config.margin, end, places) {
                return Err(pair);
            }
        }
        Ok(Self {
            way,
            swing,
            way_duration,
            release_after: time + coast,
        })
    }

    /// Returns the start of the swing, in s.
    pub fn swing_begin(&self) -> f64 {
        self.way_duration + REST
    }

    /// Returns the release time, in s.
    pub fn release(&self) -> f64 {
        self.swing_begin() + self.release_after
    }

    /// Returns positions and velocities of all joints at a time.
    pub fn at(&self, t: f64) -> ([f64; JOINTS], [f64; JOINTS]) {
        let (ramps, since) = if t < self.swing_begin() {
            (&self.way, t)
        } else {
            (&self.swing, t - self.swing_begin())
        };
        let all = ramps.map(|ramp| ramp.at(since));
        (all.map(|(q, _)| q), all.map(|(_, w)| w))
    }
}

/// Returns the first pair of bodies that comes closer than `margin` and closer than at the start.
fn touching(
    bodies: &Bodies,
    margin: f64,
    end: f64,
    at: impl Fn(f64) -> [f64; JOINTS],
) -> Option<usize> {
    let apart = |pair: usize, q: &[f64; JOINTS]| {
        let [a, b] = bodies.placed(pair, q);
        distance(&a, &b)
    };
    let first = at(0.0);
    let least: [f64; PAIRS] = std::array::from_fn(|pair| apart(pair, &first).min(margin));
    (1..=(end / CHECK_PERIOD).ceil() as usize).find_map(|i| {
        let q = at(i as f64 * CHECK_PERIOD);
        (0..PAIRS).find(|pair| apart(*pair, &q) < least[*pair] - 1e-6)
    })
}
