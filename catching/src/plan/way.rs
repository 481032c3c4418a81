//! Keeps an arm away from its own robot on its whole way: from trunk, head, torso and platform, and from the other arm
//! during its motion.
//!
//! ```text
//! cost = weight / samples  sum over samples, pairs  max(0, soft - d(q))^2 + max(0, soft - d(q_stop))^2
//! q_stop = q + dq reaction + dq |dq| / (2 a_max)
//! ```
//!
//! Here `d` is the distance between two bodies. The safety monitor brakes a robot that could otherwise not stop in
//! time, and a braking robot leaves its path. The stopping positions of the joints therefore count like their
//! positions. Samples are at equal fractions of the motion, so the gradient follows from [`Passing`] and the closest
//! points of the bodies.
//!
//! Most ways are clear without this cost. It is computed only if the way of the cheapest plan is not
//! ([`super::Planner`]).

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, joint};

use super::bodies::{BODIES, Body as SimpleBody};
use super::catch_motion::{CatchMotion, OtherArm, Point, UNKNOWNS};
use super::passing::Passing;
use crate::ramp::Ramp;
use crate::robot::{Chain, Robot};
use crate::safety::{Bodies, Hull, nearest};

/// Number of joints that move upper arm, forearm and hand.
pub(super) const MOVED_BY: [usize; 3] = [3, 5, 7];
/// Number of fixed bodies: trunk, head, two of the torso, platform.
const STILL: usize = 5;
/// Indices of trunk and torso among the fixed bodies.
pub(super) const TORSO: [usize; 3] = [0, 2, 3];
/// Number of arm parts: upper arm, forearm, hand.
const PARTS: usize = 3;
/// Amount by which an arm that starts too close may come closer, in m.
const TOO_NEAR_ALREADY: f64 = 1e-3;

tactnet_catching_packets::settings! {
    /// Distances that plans keep from the robot's own bodies.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct WayConfig {
        /// Minimum distance of a clear way, in m; 0 disables the check.
        pub hard: f64 = 0.02,
        /// Distance below which the way has a cost, in m.
        pub soft: f64 = 0.05,
        /// Weight of the squared hinge, in 1/m^2.
        pub weight: f64 = 300.0,
        /// Delay from a brake command to the braking of the drives, in s.
        pub reaction: f64 = 0.005,
        /// Number of samples for the cost along the motion, at least 1 (its end).
        pub samples: usize = 6,
        /// Number of samples for the check along the motion, at least 1 (its end).
        pub checks: usize = 24,
        /// Number of descents with this cost if the way of the cheapest plan is not clear.
        pub starts: usize = 3,
        /// Maximum number of QP iterations per such descent.
        pub iterations: usize = 15,
    }
}

/// Bodies of the robot around one arm, with all other joints in the waiting pose.
#[derive(Debug, Clone)]
pub(crate) struct OwnBodies {
    /// Simple bodies that the hand avoids at the catch.
    pub simple: [SimpleBody; BODIES],
    bodies: Bodies,
    pub(super) still: [Body; STILL],
    pub(super) arm: usize,
    waiting: [f64; JOINTS],
    other: crate::robot::ArmKinematics,
}

/// Body with its bounding sphere.
#[derive(Debug, Clone, Copy)]
pub(super) struct Body {
    pub hull: Hull,
    around: (Vector3<f64>, f64),
}

impl Body {
    fn of(hull: Hull) -> Self {
        Self {
            around: hull.ball(),
            hull,
        }
    }
}

/// Pose of the arm with the derivatives of its joints.
struct Posture {
    q: [f64; ARM_JOINTS],
    by_distance: [f64; ARM_JOINTS],
    by_end: [f64; ARM_JOINTS],
}

/// Pose of the other arm with its joint velocities.
struct OtherPosture {
    parts: [Body; PARTS],
    chain: Chain,
    rates: [f64; ARM_JOINTS],
}

impl OwnBodies {
    /// Creates the bodies for an arm: 0 left, 1 right.
    pub fn new(robot: &Robot, arm: usize) -> Self {
        let bodies = Bodies::new(robot.description());
        let waiting = robot.waiting();
        let [trunk, upper, lower] = bodies.torso(&waiting);
        let [head, platform] = bodies.head_and_platform(&waiting);
        let other = (arm + 1) % ARMS;
        Self {
            simple: SimpleBody::around_chest(arm),
            still: [trunk, head, upper, lower, platform].map(Body::of),
            bodies,
            arm,
            waiting,
            other: robot.arm(other).clone(),
        }
    }

    pub(super) fn parts(&self, arm: usize, q: &[f64; ARM_JOINTS]) -> [Body; PARTS] {
        let mut whole = self.waiting;
        whole[joint::ARM[arm].clone()].copy_from_slice(q);
        self.bodies.arm(arm, &whole).map(Body::of)
    }

    fn other(&self, motion: &CatchMotion) -> OtherArm {
        let waits = || joint::of_arm(&self.waiting, (self.arm + 1) % ARMS);
        motion.other.unwrap_or_else(|| OtherArm::standing(&waits()))
    }

    /// Returns the other arm's pose at a time, and its stopping pose if it brakes then.
    fn other_at(&self, other: &OtherArm, t: f64, reaction: f64) -> [OtherPosture; 2] {
        let t = t + other.since;
        let motion: [(f64, f64, f64); ARM_JOINTS] = std::array::from_fn(|i| {
            let ramp = &other.ramps[i];
            let (q, w) = ramp.at(t);
            let a = if t < 0.0 || t >= ramp.end {
                0.0
            } else if t < ramp.t1 {
                ramp.a
            } else if t < ramp.t2 {
                0.0
            } else {
                -ramp.a
            };
            (q, w, a)
        });
        let posture = |q: [f64; ARM_JOINTS], rates| OtherPosture {
            parts: self.parts((self.arm + 1) % ARMS, &q),
            chain: self.other.chain(&q),
            rates,
        };
        let most = |i: usize| self.other.joints()[i].acceleration;
        [
            posture(motion.map(|(q, ..)| q), motion.map(|(_, w, _)| w)),
            posture(
                std::array::from_fn(|i| {
                    let (q, w, _) = motion[i];
                    stop(q, w, reaction, most(i))
                }),
                std::array::from_fn(|i| {
                    let (_, w, a) = motion[i];
                    w + stop_by_rate(w, reaction, most(i)) * a
                }),
            ),
        ]
    }

    /// Returns the cost of the way to a point, and its gradient.
    pub fn cost(
        &self,
        config: &WayConfig,
        motion: &CatchMotion,
        x: &Point,
    ) -> (f64, [f64; UNKNOWNS]) {
        let (end, end_by) = motion.end(x);
        let mut cost = 0.0;
        let mut gradient = [0.0; UNKNOWNS];
        if !end.is_finite() || end <= 0.0 {
            return (f64::INFINITY, gradient);
        }
        let samples = config.samples.max(1);
        let weight = config.weight / samples as f64;
        let other = self.other(motion);
        let mut by_end = 0.0;
        for sample in 1..=samples {
            let share = sample as f64 / samples as f64;
            let joints = motion.passing(x, end, share);
            if !joints.iter().all(|joint| joint.q.is_finite()) {
                return (f64::INFINITY, [0.0; UNKNOWNS]);
            }
            let others = self.other_at(&other, share * end, config.reaction);
            for (posture, other) in postures(motion, &joints, config.reaction)
                .iter()
                .zip(&others)
            {
                let chain = motion.arm.chain(&posture.q);
                self.each_near(
                    posture,
                    other,
                    config.soft,
                    |part, found, radii, of_other| {
                        let lack = config.soft - found.distance;
                        cost += weight * lack * lack;
                        let pull = -2.0 * weight * lack;
                        for i in 0..MOVED_BY[part] {
                            let lever = found.point - chain.origin(i);
                            let slope = pull * found.normal.dot(&chain.axes[i].cross(&lever));
                            gradient[i] += slope * posture.by_distance[i];
                            by_end += slope * posture.by_end[i];
                        }
                        let Some(its_part) = of_other else { return };
                        // A longer motion shifts the sample in time while the other arm continues.
                        let its_point = found.point - found.normal * (found.distance + radii);
                        for i in 0..MOVED_BY[its_part] {
                            let lever = its_point - other.chain.origin(i);
                            let away = found.normal.dot(&other.chain.axes[i].cross(&lever));
                            by_end -= pull * away * other.rates[i] * share;
                        }
                    },
                );
            }
        }
        for i in 0..UNKNOWNS {
            gradient[i] += by_end * end_by[i];
        }
        (cost, gradient)
    }

    /// Calls `tell` for each pair of bodies closer than `soft`, with the arm's part, the closest points, the sum of the
    /// radii, and the other arm's part if it is one.
    fn each_near(
        &self,
        posture: &Posture,
        other: &OtherPosture,
        soft: f64,
        mut tell: impl FnMut(usize, crate::safety::Nearest, f64, Option<usize>),
    ) {
        for (part, body) in self.parts(self.arm, &posture.q).iter().enumerate() {
            let still = self.still.iter().map(|still| (still, None));
            let others = other.parts.iter().enumerate();
            for (against, its_part) in still.chain(others.map(|(i, body)| (body, Some(i)))) {
                if apart_at_least(body, against) >= soft {
                    continue;
                }
                let found = nearest(&body.hull, &against.hull);
                if found.distance < soft {
                    let radii = body.hull.radius + against.hull.radius;
                    tell(part, found, radii, its_part);
                }
            }
        }
    }

    /// Returns the minimum distance between the arm's motion along ramps and the robot's other bodies, in m, limited to
    /// `enough`. It considers the joint positions and stopping positions at `checks` samples.
    pub fn least(
        &self,
        config: &WayConfig,
        motion: &CatchMotion,
        ramps: &[Ramp; ARM_JOINTS],
        enough: f64,
    ) -> f64 {
        let end = ramps.iter().map(|ramp| ramp.end).fold(0.0, f64::max);
        let other = self.other(motion);
        let checks = config.checks.max(1);
        let mut least = enough;
        for check in 1..=checks {
            let t = end * check as f64 / checks as f64;
            let states = ramps.map(|ramp| ramp.at(t));
            let most = |i: usize| motion.joints[i].acceleration;
            let stops =
                std::array::from_fn(|i| stop(states[i].0, states[i].1, config.reaction, most(i)));
            let others = self.other_at(&other, t, config.reaction);
            for (q, other) in [states.map(|(q, _)| q), stops].iter().zip(&others) {
                least = least.min(self.distance(q, &other.parts, least));
            }
        }
        least
    }

    /// Returns the minimum distance between the arm at `q` and the other bodies, in m, limited to `enough`.
    fn distance(&self, q: &[f64; ARM_JOINTS], other: &[Body; PARTS], enough: f64) -> f64 {
        let mut least = enough;
        for body in &self.parts(self.arm, q) {
            for against in self.still.iter().chain(other) {
                if apart_at_least(body, against) < least {
                    least = least.min(nearest(&body.hull, &against.hull).distance);
                }
            }
        }
        least
    }

    /// Returns true if the motion keeps the distance `hard` from the robot's other bodies, or, if the arm starts
    /// closer, does not come closer.
    pub fn is_clear(
        &self,
        config: &WayConfig,
        motion: &CatchMotion,
        ramps: &[Ramp; ARM_JOINTS],
    ) -> bool {
        if config.hard <= 0.0 {
            return true;
        }
        let [at, stopped] = self.other_at(&self.other(motion), 0.0, config.reaction);
        let stops = std::array::from_fn(|i| {
            let most = motion.joints[i].acceleration;
            stop(motion.q0[i], motion.w0[i], config.reaction, most)
        });
        let begin = self.distance(&motion.q0, &at.parts, config.hard + TOO_NEAR_ALREADY);
        let begin = begin.min(self.distance(&stops, &stopped.parts, begin));
        let bound = config.hard.min(begin - TOO_NEAR_ALREADY);
        self.least(config, motion, ramps, bound) >= bound
    }
}

/// Returns a lower bound of the distance between two bodies.
pub(super) fn apart_at_least(a: &Body, b: &Body) -> f64 {
    (a.around.0 - b.around.0).norm() - a.around.1 - b.around.1
}

/// Returns the stopping position of a joint that brakes after `reaction` seconds.
fn stop(q: f64, w: f64, reaction: f64, most: f64) -> f64 {
    q + w * reaction + w * w.abs() / (2.0 * most)
}

fn stop_by_rate(w: f64, reaction: f64, most: f64) -> f64 {
    reaction + w.abs() / most
}

/// Returns the pose of the joints, and their stopping pose.
fn postures(motion: &CatchMotion, joints: &[Passing; ARM_JOINTS], reaction: f64) -> [Posture; 2] {
    let most = |i: usize| motion.joints[i].acceleration;
    let by_rate = |i: usize| stop_by_rate(joints[i].rate, reaction, most(i));

    [
        Posture {
            q: joints.map(|joint| joint.q),
            by_distance: joints.map(|joint| joint.by_distance),
            by_end: joints.map(|joint| joint.by_end),
        },
        Posture {
            q: std::array::from_fn(|i| stop(joints[i].q, joints[i].rate, reaction, most(i))),
            by_distance: std::array::from_fn(|i| {
                joints[i].by_distance + by_rate(i) * joints[i].rate_by_distance
            }),
            by_end: std::array::from_fn(|i| joints[i].by_end + by_rate(i) * joints[i].rate_by_end),
        },
    ]
}

#[cfg(test)]
mod tests;
