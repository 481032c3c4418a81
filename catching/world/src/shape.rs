//! Shape of the true robot, for contacts and depth pictures: capsules on its links.
//!
//! The sizes belong to this world and differ from those of the stack.

use nalgebra::Vector3;
use tactnet_catching_packets::{ARMS, RobotDescription};

use crate::kinematics::{BODIES, CHEST, HAND, HEAD, Place};

/// Number of capsules of the robot.
pub(crate) const CAPSULES: usize = 9 + ARMS * (4 + FINGERS);
const FINGERS: usize = 4;

/// Set of all points within `radius` of a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Capsule {
    pub(crate) part: &'static str,
    /// Index of the body in the tree.
    body: usize,
    ends: [Vector3<f64>; 2],
    pub(crate) radius: f64,
}

/// A capsule at its current place in the inertial frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PlacedCapsule {
    pub(crate) ends: [Vector3<f64>; 2],
    pub(crate) radius: f64,
}

impl Capsule {
    pub(crate) fn placed(&self, places: &[Place; BODIES]) -> PlacedCapsule {
        let place = &places[self.body];
        PlacedCapsule {
            ends: self.ends.map(|end| place.position + place.rotation * end),
            radius: self.radius,
        }
    }

    /// Returns true for parts that the camera in the head cannot see.
    pub(crate) fn is_head(&self) -> bool {
        self.body == HEAD
    }
}

pub(crate) fn capsules(robot: &RobotDescription) -> [Capsule; CAPSULES] {
    let mut capsules = Vec::with_capacity(CAPSULES);
    let mut add = |part, body, from: [f64; 3], to: [f64; 3], radius| {
        capsules.push(Capsule {
            part,
            body,
            ends: [from.into(), to.into()],
            radius,
        });
    };
    let (lower, upper) = (robot.torso.lower_length, robot.torso.upper_length);
    add("platform", 0, [-0.2, -0.1, 0.25], [0.2, -0.1, 0.25], 0.22);
    add("platform", 0, [-0.2, 0.1, 0.25], [0.2, 0.1, 0.25], 0.22);
    add("column", 1, [0.0, 0.0, -0.2], [0.0; 3], 0.12);
    add("lower torso", 2, [0.0; 3], [0.0, 0.0, lower], 0.11);
    add("upper torso", 3, [0.0; 3], [0.0, 0.0, upper - 0.15], 0.1);
    for y in [-0.1, 0.1] {
        add("trunk", CHEST, [0.0, y, -0.1], [0.0, y, 0.05], 0.12);
    }
    add("head", HEAD, [0.04, -0.08, 0.11], [0.04, 0.08, 0.11], 0.1);
    add("neck", 5, [0.0, 0.0, -0.1], [0.0; 3], 0.07);
    for (arm, hand) in robot.arms.iter().zip(HAND) {
        let shoulder = hand - 6;
        // The mount does not rotate with the first joint, but lies along its axis.
        let mount = [0.0, 0.0, -arm.base_to_shoulder];
        add("mount", shoulder, mount, [0.0; 3], 0.075);
        let along = |length: f64| [0.0, 0.0, length];
        let [elbow, wrist] = [arm.shoulder_to_elbow, arm.elbow_to_wrist].map(along);
        add("upper arm", shoulder + 2, [0.0; 3], elbow, 0.075);
        add("forearm", shoulder + 4, [0.0; 3], wrist, 0.065);
        let catch = arm.wrist_to_catch;
        add("palm", hand, along(0.03), along(catch - 0.13), 0.055);
        for finger in 0..FINGERS {
            let angle = std::f64::consts::FRAC_PI_2 * finger as f64;
            let around = |radius: f64, z: f64| [radius * angle.cos(), radius * angle.sin(), z];
            let (base, tip) = (around(0.05, catch - 0.12), around(0.09, catch + 0.04));
            add("finger", hand, base, tip, 0.018);
        }
    }
    capsules
        .try_into()
        .expect("as many capsules as were counted")
}

impl PlacedCapsule {
    pub(crate) fn middle(&self) -> Vector3<f64> {
        (self.ends[0] + self.ends[1]) * 0.5
    }

    /// Returns the radius of the bounding sphere around the centre, in m.
    pub(crate) fn reach(&self) -> f64 {
        0.5 * (self.ends[1] - self.ends[0]).norm() + self.radius
    }

    /// Returns the distance from `origin`, which is outside, to the surface in units of `direction`, or `None` if the
    /// ray misses the capsule.
    pub(crate) fn on_ray(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Option<f64> {
        let [a, b] = self.ends;
        let axis = b - a;
        let from = origin - a;
        let length = axis.norm_squared();
        let square = self.radius * self.radius;
        let mut nearest: Option<f64> = None;
        let mut take = |t: f64| {
            if t >= 0.0 && nearest.is_none_or(|least| t < least) {
                nearest = Some(t);
            }
        };
        // Intersection with the cylinder between the ends of the segment.
        if length > 0.0 {
            let across = |v: &Vector3<f64>| v - axis * (v.dot(&axis) / length);
            let (d, m) = (across(direction), across(&from));
            if let Some(t) = first_root(d.norm_squared(), d.dot(&m), m.norm_squared() - square) {
                let share = (from + direction * t).dot(&axis) / length;
                if (0.0..=1.0).contains(&share) {
                    take(t);
                }
            }
        }
        for end in [a, b] {
            let m = origin - end;
            let root = first_root(
                direction.norm_squared(),
                direction.dot(&m),
                m.norm_squared() - square,
            );
            root.into_iter().for_each(&mut take);
        }
        nearest
    }
}

/// Returns the smaller root of `a t^2 + 2 b t + c`.
fn first_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let inside = b * b - a * c;
    (inside >= 0.0 && a > 0.0).then(|| (-b - inside.sqrt()) / a)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn away(capsule: &PlacedCapsule, p: &Vector3<f64>) -> f64 {
        let [a, b] = capsule.ends;
        let axis = b - a;
        let share = ((p - a).dot(&axis) / axis.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        (p - a - axis * share).norm() - capsule.radius
    }

    proptest! {
        #[test]
        fn rays_end_at_the_surface(ends in proptest::array::uniform2(proptest::array::uniform3(-1.0..1.0f64)), radius in 0.02..0.4f64, o in proptest::array::uniform3(-2.0..2.0f64), to in proptest::array::uniform3(-1.0..1.0f64)) {
            let capsule = PlacedCapsule { ends: ends.map(Vector3::from), radius };
            let (origin, to) = (Vector3::from(o), Vector3::from(to));
            prop_assume!(away(&capsule, &origin) > 1e-3);
            let direction = to - origin;
            let first = capsule.on_ray(&origin, &direction);
            if let Some(t) = first {
                prop_assert!(away(&capsule, &(origin + direction * t)).abs() < 1e-7);
            }
            for i in 0..200 {
                let t = f64::from(i) * 0.02;
                prop_assert!(first.is_some_and(|first| t > first) || away(&capsule, &(origin + direction * t)) > -1e-9);
            }
        }
    }
}
