//! Distance of an arm from trunk and torso at a catch.
//!
//! The bodies of [`Body`](super::Body) keep only the hand away, as in the thesis; forearm and elbow may still come
//! close. The way to the catch is checked in [`way`](super::way).

use nalgebra::{SMatrix, Vector3};
use tactnet_catching_packets::ARM_JOINTS;

use super::way::{MOVED_BY, OwnBodies, TORSO, apart_at_least};
use crate::robot::HandPose;
use crate::safety::{Nearest, nearest};

/// Index of the part that is closest most often.
const FOREARM: usize = 1;

impl OwnBodies {
    /// Returns the minimum distance between the arm and trunk or torso, in m, and its derivative with respect to each
    /// joint.
    ///
    /// - `pose`, `jacobian`: of the hand, with the arm at `q`
    pub fn clearance_slope(
        &self,
        q: &[f64; ARM_JOINTS],
        pose: &HandPose,
        jacobian: &SMatrix<f64, 6, ARM_JOINTS>,
    ) -> (f64, [f64; ARM_JOINTS]) {
        let (part, found) = self.pair(q);
        // The point moves rigidly with the hand for joints of the body it belongs to and does not move for joints beyond it.
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

    /// Returns the minimum distance between the arm and trunk or torso, in m.
    pub fn clearance(&self, q: &[f64; ARM_JOINTS]) -> f64 {
        self.pair(q).1.distance
    }

    /// Returns the part of the arm that is closest to trunk or torso, and the closest points.
    fn pair(&self, q: &[f64; ARM_JOINTS]) -> (usize, Nearest) {
        let parts = self.parts(self.arm, q);
        let first = nearest(&parts[FOREARM].hull, &self.still[TORSO[0]].hull);
        let mut least = (FOREARM, first);
        for (part, body) in parts.iter().enumerate() {
            for i in TORSO {
                let torso = &self.still[i];
                let known = (part, i) == (FOREARM, TORSO[0]);
                if known || apart_at_least(body, torso) >= least.1.distance {
                    continue;
                }
                let found = nearest(&body.hull, &torso.hull);
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
    use crate::robot::Robot;
    use proptest::prelude::*;
    use tactnet_catching_packets::ARMS;

    #[test]
    fn an_arm_that_turns_into_the_trunk_is_not_clear_of_it() {
        let robot = Robot::nominal();
        for arm in 0..ARMS {
            let own = OwnBodies::new(&robot, arm);
            let ready = robot.ready(arm);
            assert!(own.clearance(&ready) > 0.05);
            // Turn one joint to an end of its range, until the forearm touches the trunk.
            let joints = robot.arm(arm).joints();
            let nearest = (0..ARM_JOINTS)
                .flat_map(|joint| joints[joint].range.map(|end| (joint, end)))
                .map(|(joint, end)| {
                    let mut q = ready;
                    q[joint] = end;
                    own.clearance(&q)
                })
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.01, "{nearest}");
        }
    }

    proptest! {
        #[test]
        fn slopes_are_differences(q in proptest::array::uniform7(-1.0..1.0f64), arm in 0..ARMS) {
            let robot = Robot::nominal();
            let own = OwnBodies::new(&robot, arm);
            let joints = robot.arm(arm).joints();
            let q: [f64; ARM_JOINTS] = std::array::from_fn(|i| {
                let [low, high] = joints[i].range;
                0.5 * (low + high) + 0.5 * q[i] * (high - low)
            });
            let (pose, jacobian) = robot.arm(arm).jacobian(&q);
            let (least, slope) = own.clearance_slope(&q, &pose, &jacobian);
            prop_assert_eq!(least, own.clearance(&q));
            let moved = |i: usize, by: f64| {
                let mut q = q;
                q[i] += by;
                own.clearance(&q)
            };
            for i in 0..ARM_JOINTS {
                let (less, more) = (moved(i, -1e-5), moved(i, 1e-5));
                // The distance has a kink where the closest pair changes, and no slope where bodies penetrate.
                prop_assume!(least > -0.1 && (less + more - 2.0 * least).abs() < 1e-8);
                prop_assert!(((more - less) / 2e-5 - slope[i]).abs() < 1e-3, "{i}: {} {}", (more - less) / 2e-5, slope[i]);
            }
        }
    }
}
