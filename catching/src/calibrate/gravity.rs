//! Gravity torques of an arm.

use nalgebra::Vector3;
use tactnet_catching_packets::{ARM_JOINTS, RobotDescription};

use crate::pose::GRAVITY;
use crate::robot::Robot;

/// Returns the gravity torques about an arm's joints, in Nm, from the described masses. The chest is upright.
///
/// - `q`: link angles, in rad
pub fn loads(robot: &Robot, arm: usize, q: &[f64; ARM_JOINTS]) -> [f64; ARM_JOINTS] {
    let description: &RobotDescription = robot.description();
    let frames = robot.arm(arm).links(q);
    let mut loads = [0.0; ARM_JOINTS];
    // Mass and first moment of mass of all links from `i` on.
    let (mut mass, mut moment) = (0.0, Vector3::zeros());
    for i in (0..ARM_JOINTS).rev() {
        let link = &description.arms[arm].links[i];
        let frame = &frames[i];
        mass += link.mass;
        moment += (frame.origin + frame.rotation * Vector3::from(link.centre)) * link.mass;
        let about = (moment - frame.origin * mass).cross(&Vector3::new(0.0, 0.0, -GRAVITY));
        loads[i] = frame.axis.dot(&about);
    }
    loads
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn potential(robot: &Robot, arm: usize, q: &[f64; ARM_JOINTS]) -> f64 {
        let links = &robot.description().arms[arm].links;
        let frames = robot.arm(arm).links(q);
        links
            .iter()
            .zip(&frames)
            .map(|(link, frame)| {
                let centre = frame.origin + frame.rotation * Vector3::from(link.centre);
                link.mass * GRAVITY * centre.z
            })
            .sum()
    }

    proptest! {
        /// Gravity torques equal the negative gradient of the potential energy.
        #[test]
        fn loads_are_the_potentials_slope(
            arm in 0..2usize,
            q in proptest::array::uniform7(-2.0..2.0f64),
        ) {
            let robot = Robot::nominal();
            let loads = loads(&robot, arm, &q);
            let h = 1e-5;
            for i in 0..ARM_JOINTS {
                let at = |step: f64| {
                    let mut q = q;
                    q[i] += step;
                    potential(&robot, arm, &q)
                };
                // Energies are about 100 J: rounding error 1e-14 / h, truncation error h^2.
                prop_assert!((loads[i] + (at(h) - at(-h)) / (2.0 * h)).abs() < 1e-6);
            }
        }

        #[test]
        fn the_last_link_ends_in_the_catch_frame(
            arm in 0..2usize,
            q in proptest::array::uniform7(-2.0..2.0f64),
        ) {
            let robot = Robot::nominal();
            let last = robot.arm(arm).links(&q)[ARM_JOINTS - 1];
            let hand = robot.arm(arm).forward(&q);
            let ahead = robot.description().arms[arm].wrist_to_catch;
            let catch = last.origin + last.rotation.column(2) * ahead;
            prop_assert!((catch - hand.position).norm() < 1e-12);
            prop_assert!((last.rotation - hand.rotation).norm() < 1e-12);
        }
    }
}
