//! Kinematics of the throwing hand: an arm on a rotating base, with eight joints and derivatives.
//!
//! The base rotates about the vertical axis through the platform's centre. The simulated platform cannot rotate; the
//! torso's vertical joint (joint 1) has the same axis and takes that role, with its limits.

use nalgebra::{SMatrix, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, JOINTS, Joint, THROW_JOINTS, joint};

use crate::robot::{ArmKinematics, Robot};

/// One value per throwing joint.
pub type ThrowJoints = [f64; THROW_JOINTS];

/// Derivatives of a vector with respect to the throwing joints.
pub(crate) type Slopes = SMatrix<f64, 3, THROW_JOINTS>;

/// Arm on the rotating base.
#[derive(Debug, Clone)]
pub struct Swing {
    pub(crate) arm: ArmKinematics,
    pub(crate) number: usize,
    /// Limits of the rotation and the arm's joints.
    pub(crate) joints: [Joint; THROW_JOINTS],
    /// Position of the rotation axis on the floor in the inertial frame, in m.
    foot: Vector3<f64>,
    /// Vector from there to the chest without rotation.
    chest: Vector3<f64>,
}

/// Pose and motion of the hand in the inertial frame, with derivatives with respect to joint angles. The derivative of
/// `v` with respect to joint velocities equals `p_by_q`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HandMotion {
    /// Centre of the hand's opening, in m.
    pub p: Vector3<f64>,
    /// Velocity, in m/s.
    pub v: Vector3<f64>,
    /// Hand axis, pointing away from the wrist.
    pub axis: Vector3<f64>,
    pub p_by_q: Slopes,
    pub v_by_q: Slopes,
    pub axis_by_q: Slopes,
}

impl Swing {
    /// Creates the kinematics of an arm (0 left, 1 right) with platform and torso pitch joints as in `posture`.
    pub fn new(robot: &Robot, number: usize, posture: &[f64; JOINTS]) -> Self {
        let mut ahead = *posture;
        ahead[joint::TORSO.start] = 0.0;
        let foot = Vector3::new(0.0, posture[joint::PLATFORM], 0.0);
        Self {
            arm: robot.arm(number).clone(),
            number,
            joints: std::array::from_fn(|i| robot.joints()[throw_joint(number, i)]),
            chest: robot.chest(&ahead).translation.vector - foot,
            foot,
        }
    }

    /// Returns position and velocity of the hand in the inertial frame, in m and m/s.
    pub fn hand(&self, q: &ThrowJoints, rates: &ThrowJoints) -> (Vector3<f64>, Vector3<f64>) {
        let motion = self.motion(q, rates);
        (motion.p, motion.v)
    }

    /// Returns the hand with its derivatives.
    ///
    /// Joint k rotates everything behind it: `dJ_i/dq_k = a_k x J_i` for `i >= k`, `a_i x J_k` for `i < k`.
    pub(crate) fn motion(&self, q: &ThrowJoints, rates: &ThrowJoints) -> HandMotion {
        let (pose, jacobian) = self.arm.jacobian(&std::array::from_fn(|i| q[i + 1]));
        let (sin, cos) = q[0].sin_cos();
        let turned =
            |v: Vector3<f64>| Vector3::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
        let from_foot = turned(self.chest + pose.position);
        let mut axes = Slopes::zeros();
        let mut linear = Slopes::zeros();
        axes.set_column(0, &Vector3::z());
        linear.set_column(0, &Vector3::z().cross(&from_foot));
        for i in 0..ARM_JOINTS {
            let moved: Vector3<f64> = jacobian.fixed_view::<3, 1>(0, i).into_owned();
            let axis: Vector3<f64> = jacobian.fixed_view::<3, 1>(3, i).into_owned();
            linear.set_column(i + 1, &turned(moved));
            axes.set_column(i + 1, &turned(axis));
        }
        let axis = turned(pose.rotation.column(2).into_owned());
        let mut v_by_q = Slopes::zeros();
        let mut axis_by_q = Slopes::zeros();
        let column = |m: &Slopes, i: usize| -> Vector3<f64> { m.column(i).into_owned() };
        // First the velocity contributed by joint k and all joints behind it, then the rotation of the joints before
        // it.
        let mut behind = Vector3::zeros();
        for k in (0..THROW_JOINTS).rev() {
            behind += column(&linear, k) * rates[k];
            v_by_q.set_column(k, &column(&axes, k).cross(&behind));
            axis_by_q.set_column(k, &column(&axes, k).cross(&axis));
        }
        let mut before = Vector3::zeros();
        for k in 0..THROW_JOINTS {
            let more = before.cross(&column(&linear, k));
            v_by_q.set_column(k, &(column(&v_by_q, k) + more));
            before += column(&axes, k) * rates[k];
        }
        HandMotion {
            p: self.foot + from_foot,
            v: behind,
            axis,
            p_by_q: linear,
            v_by_q,
            axis_by_q,
        }
    }
}

/// Returns the packet index of joint `i` of a throw with an arm.
pub fn throw_joint(arm: usize, i: usize) -> usize {
    if i == 0 {
        joint::TORSO.start
    } else {
        joint::ARM[arm].start + i - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::ARMS;

    proptest! {
        #[test]
        fn the_hand_is_the_robots_and_derivatives_are_differences(
            q in proptest::array::uniform8(-1.5..1.5f64), rates in proptest::array::uniform8(-2.0..2.0f64), arm in 0..ARMS, aside in -0.4..0.4f64,
        ) {
            let robot = Robot::nominal();
            let mut whole = robot.waiting();
            whole[joint::PLATFORM] = aside;
            whole[joint::TORSO.start + 1] = 0.2;
            let swing = Swing::new(&robot, arm, &whole);
            for i in 0..THROW_JOINTS {
                whole[throw_joint(arm, i)] = q[i];
            }
            let motion = swing.motion(&q, &rates);
            let by_robot = robot.chest(&whole) * nalgebra::Point3::from(robot.arm(arm).forward(&std::array::from_fn(|i| q[i + 1])).position);
            prop_assert!((by_robot.coords - motion.p).norm() < 1e-12);
            let h = 1e-6;
            let along = |by: f64| swing.motion(&std::array::from_fn(|i| q[i] + by * rates[i]), &rates).p;
            prop_assert!(((along(h) - along(-h)) / (2.0 * h) - motion.v).norm() < 1e-8);
            for k in 0..THROW_JOINTS {
                let moved = |by: f64| {
                    let mut q = q;
                    q[k] += by;
                    swing.motion(&q, &rates)
                };
                let (more, less) = (moved(h), moved(-h));
                prop_assert!(((more.p - less.p) / (2.0 * h) - motion.p_by_q.column(k)).norm() < 1e-8);
                prop_assert!(((more.v - less.v) / (2.0 * h) - motion.v_by_q.column(k)).norm() < 1e-7);
                prop_assert!(((more.axis - less.axis) / (2.0 * h) - motion.axis_by_q.column(k)).norm() < 1e-8);
            }
        }
    }
}
