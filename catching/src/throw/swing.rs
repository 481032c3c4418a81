//! The hand that throws: an arm on the platform's turn, eight joints, with derivatives.
//!
//! The turn is about the vertical axis over the platform's middle. The robot of simulations has no platform that turns; it has the torso's
//! vertical axis in the same place, and that is the turn here: joint 1 of a robot, with its limits.

use nalgebra::{SMatrix, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, JOINTS, Joint, THROW_JOINTS, joint};

use crate::robot::{ArmKinematics, Robot};

/// A number for each of them.
pub type ThrowJoints = [f64; THROW_JOINTS];

/// Derivatives of a vector by them.
pub(crate) type Slopes = SMatrix<f64, 3, THROW_JOINTS>;

/// An arm on the turn.
#[derive(Debug, Clone)]
pub struct Swing {
    arm: ArmKinematics,
    number: usize,
    joints: [Joint; THROW_JOINTS],
    /// Of the turn's axis, m, inertial frame.
    foot: Vector3<f64>,
    /// From there to the chest, without turn.
    chest: Vector3<f64>,
}

/// Where the hand is and how it moves, inertial frame, with derivatives by joint angles; those of the velocity by joint rates are
/// `by_q`'s.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HandMotion {
    /// Middle of the opening, m.
    pub p: Vector3<f64>,
    /// m/s.
    pub v: Vector3<f64>,
    /// The hand's axis, away from the wrist.
    pub axis: Vector3<f64>,
    pub p_by_q: Slopes,
    pub v_by_q: Slopes,
    pub axis_by_q: Slopes,
}

impl Swing {
    /// Prepares an arm (0 left, 1 right) of a robot whose platform and torso's pitches stand as in `posture`.
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

    /// Returns the limits of the turn and the arm's joints.
    pub fn joints(&self) -> &[Joint; THROW_JOINTS] {
        &self.joints
    }

    /// Returns which arm it is.
    pub fn number(&self) -> usize {
        self.number
    }

    pub(crate) fn arm(&self) -> &ArmKinematics {
        &self.arm
    }

    /// Returns place and velocity of the hand's middle, m and m/s, inertial frame.
    pub fn hand(&self, q: &ThrowJoints, rates: &ThrowJoints) -> (Vector3<f64>, Vector3<f64>) {
        let motion = self.motion(q, rates);
        (motion.p, motion.v)
    }

    /// Returns the hand with its derivatives.
    ///
    /// A joint k turns whatever lies behind it: `dJ_i/dq_k = a_k x J_i` for `i >= k`, `a_i x J_k` for `i < k`.
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
        // Of the joints behind k, k among them; and how those before it turn.
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

/// Returns where joint `i` of a throw with an arm stands in packets.
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
    use tactnet_catching_packets::{ARMS, RobotDescription};

    proptest! {
        #[test]
        fn the_hand_is_the_robots_and_derivatives_are_differences(
            q in proptest::array::uniform8(-1.5..1.5f64), rates in proptest::array::uniform8(-2.0..2.0f64), arm in 0..ARMS, aside in -0.4..0.4f64,
        ) {
            let robot = Robot::new(RobotDescription::nominal());
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
