//! How far an arm is away from the trunk and the torso at a catch.
//!
//! The bodies of [`Body`](super::Body) keep the middle of the hand away, as in the thesis; forearm and elbow may still come near. The way to
//! the catch is looked at in [`way`](super::way).

use nalgebra::{SMatrix, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, JOINTS, joint};

use crate::robot::{HandPose, Robot};
use crate::safety::{Bodies, Hull, Nearest, nearest};

/// Joints of the arm that move upper arm, forearm and hand.
const MOVED_BY: [usize; 3] = [3, 5, 7];
/// The part that is nearest most often.
const FOREARM: usize = 1;

/// An arm beside a trunk and a torso that stand as the robot waits.
#[derive(Debug, Clone)]
pub(crate) struct Clearance {
    bodies: Bodies,
    torso: [Hull; 3],
    /// Balls around those.
    around: [(Vector3<f64>, f64); 3],
    arm: usize,
    waiting: [f64; JOINTS],
}

impl Clearance {
    /// Prepares an arm: 0 left, 1 right.
    pub fn new(robot: &Robot, arm: usize) -> Self {
        let bodies = Bodies::new(robot.description());
        let waiting = robot.waiting();
        let torso = bodies.torso(&waiting);
        Self {
            around: torso.each_ref().map(Hull::ball),
            torso,
            arm,
            waiting,
            bodies,
        }
    }

    /// Returns the least distance of the arm's bodies from trunk and torso, m, and its derivative by joint.
    ///
    /// - `pose`, `jacobian`: of the hand, with the arm at `q`
    pub fn nearest(
        &self,
        q: &[f64; ARM_JOINTS],
        pose: &HandPose,
        jacobian: &SMatrix<f64, 6, ARM_JOINTS>,
    ) -> (f64, [f64; ARM_JOINTS]) {
        let (part, found) = self.pair(q);
        // A point that moves with the hand would do so; joints beyond its own body do not move it.
        let from_hand = found.point - pose.position;
        let slope = std::array::from_fn(|i| {
            if i >= MOVED_BY[part] {
                return 0.0;
            }
            let moved: Vector3<f64> = jacobian.fixed_view::<3, 1>(0, i).into_owned();
            let turned: Vector3<f64> = jacobian.fixed_view::<3, 1>(3, i).into_owned();
            found.normal.dot(&(moved + turned.cross(&from_hand)))
        });
        (found.distance, slope)
    }

    /// Returns the least distance of the arm's bodies from trunk and torso, m.
    pub fn at(&self, q: &[f64; ARM_JOINTS]) -> f64 {
        self.pair(q).1.distance
    }

    /// Returns the part of the arm that is nearest to trunk or torso, and where.
    fn pair(&self, q: &[f64; ARM_JOINTS]) -> (usize, Nearest) {
        let mut whole = self.waiting;
        whole[joint::ARM[self.arm].clone()].copy_from_slice(q);
        let parts = self.bodies.arm(self.arm, &whole);
        let mut least = (FOREARM, nearest(&parts[FOREARM], &self.torso[0]));
        for (part, hull) in parts.iter().enumerate() {
            let (centre, radius) = hull.ball();
            for (body, (torso, around)) in self.torso.iter().zip(&self.around).enumerate() {
                let no_nearer = (centre - around.0).norm() - radius - around.1;
                if (part, body) == (FOREARM, 0) || no_nearer >= least.1.distance {
                    continue;
                }
                let found = nearest(hull, torso);
                if found.distance < least.1.distance {
                    least = (part, found);
                }
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::{ARMS, RobotDescription};

    #[test]
    fn an_arm_that_turns_into_the_trunk_is_not_clear_of_it() {
        let robot = Robot::new(RobotDescription::nominal());
        for arm in 0..ARMS {
            let clearance = Clearance::new(&robot, arm);
            let ready = robot.ready(arm);
            assert!(clearance.at(&ready) > 0.05);
            // One joint turns on, as far as it goes, until the forearm lies at the trunk.
            let joints = robot.arm(arm).joints();
            let nearest = (0..ARM_JOINTS)
                .flat_map(|joint| joints[joint].range.map(|end| (joint, end)))
                .map(|(joint, end)| {
                    let mut q = ready;
                    q[joint] = end;
                    clearance.at(&q)
                })
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.01, "{nearest}");
        }
    }

    proptest! {
        #[test]
        fn slopes_are_differences(q in proptest::array::uniform7(-1.0..1.0f64), arm in 0..ARMS) {
            let robot = Robot::new(RobotDescription::nominal());
            let clearance = Clearance::new(&robot, arm);
            let joints = robot.arm(arm).joints();
            let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| {
                let [low, high] = joints[i].range;
                0.5 * (low + high) + 0.5 * q[i] * (high - low)
            });
            let (pose, jacobian) = robot.arm(arm).jacobian(&q);
            let (least, slope) = clearance.nearest(&q, &pose, &jacobian);
            prop_assert_eq!(least, clearance.at(&q));
            let moved = |i: usize, by: f64| {
                let mut q = q;
                q[i] += by;
                clearance.at(&q)
            };
            for i in 0..ARM_JOINTS {
                let (less, more) = (moved(i, -1e-5), moved(i, 1e-5));
                // Where another pair is the nearest one, or bodies reach into each other, there is no slope.
                prop_assume!(least > -0.1 && (less + more - 2.0 * least).abs() < 1e-8);
                prop_assert!(((more - less) / 2e-5 - slope[i]).abs() < 1e-3, "{i}: {} {}", (more - less) / 2e-5, slope[i]);
            }
        }
    }
}
