//! Sphere model of the robot by forward kinematics with derivatives: 42 spheres for both arms and 14 for the body.
//!
//! Upper arm and forearm are rows of spheres that contain the capsules of the self-collision monitor. The hand consists
//! of three spheres for the palm and a ring of six around the open fingers.

use nalgebra::{Isometry3, Point3, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS};

use super::field::DistanceField;
use crate::robot::{Chain, Robot};

/// Number of spheres per arm.
pub const ARM_SPHERES: usize = 21;
/// Number of spheres for trunk, head, torso and the arms' mounts.
pub const STILL_SPHERES: usize = 14;

/// Number of spheres of the upper arm, and of the forearm.
const OF_LINK: usize = 6;
/// Sphere radius of upper arm and forearm, in m: capsules of 7.5 and 6.5 cm, with steps of 8 cm.
const LINK_RADIUS: [f64; 2] = [0.085, 0.076];
/// Positions of the palm's spheres along the hand axis, in m from the wrist.
const PALM: [f64; 3] = [0.04, 0.1, 0.16];
/// Radius of the palm's spheres, in m.
const PALM_RADIUS: f64 = 0.07;
/// Ring of spheres around the fingers: radius of the ring, offset from the catch frame along the hand axis, and radius
/// of a sphere, in m.
const RING: [f64; 3] = [0.07, 0.005, 0.08];
const OF_RING: usize = ARM_SPHERES - 2 * OF_LINK - PALM.len();

/// Sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Centre, in m.
    pub centre: Vector3<f64>,
    /// Radius, in m.
    pub radius: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    /// Fraction of the way from shoulder to elbow.
    Upper(f64),
    /// Fraction of the way from elbow to wrist.
    Fore(f64),
    /// Position relative to the wrist, along the axes of the catch frame, in m.
    Hand(Vector3<f64>),
}

/// Spheres of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmSpheres {
    places: [(Place, f64); ARM_SPHERES],
}

impl ArmSpheres {
    /// Creates the spheres of an arm: 0 left, 1 right.
    pub fn new(robot: &Robot, arm: usize) -> Self {
        let to_catch = robot.description().arms[arm].wrist_to_catch;
        let places = std::array::from_fn(|i| {
            let share = (i % OF_LINK) as f64 / (OF_LINK - 1) as f64;
            let (of_link, of_palm) = (2 * OF_LINK, 2 * OF_LINK + PALM.len());
            if i < OF_LINK {
                (Place::Upper(share), LINK_RADIUS[0])
            } else if i < of_link {
                (Place::Fore(share), LINK_RADIUS[1])
            } else if i < of_palm {
                let along = Vector3::new(0.0, 0.0, PALM[i - of_link]);
                (Place::Hand(along), PALM_RADIUS)
            } else {
                let angle = (i - of_palm) as f64 * std::f64::consts::TAU / OF_RING as f64;
                let [ring, along, radius] = RING;
                let place = Vector3::new(ring * angle.cos(), ring * angle.sin(), to_catch + along);
                (Place::Hand(place), radius)
            }
        });
        Self { places }
    }

    /// Returns the radius of a sphere, in m.
    pub fn radius(&self, sphere: usize) -> f64 {
        self.places[sphere].1
    }

    /// Returns the centre of a sphere in the chest frame, in m.
    pub(crate) fn centre(&self, sphere: usize, chain: &Chain) -> Vector3<f64> {
        match &self.places[sphere].0 {
            Place::Upper(share) => chain.shoulder + (chain.elbow - chain.shoulder) * *share,
            Place::Fore(share) => chain.elbow + (chain.wrist - chain.elbow) * *share,
            Place::Hand(from_wrist) => chain.wrist + chain.rotation * from_wrist,
        }
    }

    /// Returns the derivatives with respect to the joints of a function of a sphere's centre with the given gradient.
    pub(crate) fn slopes(
        &self,
        sphere: usize,
        chain: &Chain,
        centre: &Vector3<f64>,
        gradient: &Vector3<f64>,
    ) -> [f64; ARM_JOINTS] {
        let moved_by = match self.places[sphere].0 {
            Place::Upper(_) => 2,
            Place::Fore(_) => 4,
            Place::Hand(_) => ARM_JOINTS,
        };
        std::array::from_fn(|joint| {
            if joint >= moved_by {
                return 0.0;
            }
            let lever = centre - chain.origin(joint);
            chain.axes[joint].cross(&lever).dot(gradient)
        })
    }

    /// Returns the minimum distance between the spheres and the obstacles of a map, in m.
    ///
    /// - `chest`: pose of the chest in the map frame
    pub(crate) fn distance(
        &self,
        chain: &Chain,
        chest: &Isometry3<f64>,
        field: &DistanceField,
    ) -> f64 {
        (0..ARM_SPHERES).fold(f64::INFINITY, |least, sphere| {
            let centre = chest * Point3::from(self.centre(sphere, chain));
            least.min(field.distance(&centre.coords) - self.radius(sphere))
        })
    }

    /// Returns all spheres at arm angles `q`, in the chest frame.
    pub fn placed(
        &self,
        robot: &Robot,
        arm: usize,
        q: &[f64; ARM_JOINTS],
    ) -> [Sphere; ARM_SPHERES] {
        let chain = robot.arm(arm).chain(q);
        std::array::from_fn(|i| Sphere {
            centre: self.centre(i, &chain),
            radius: self.radius(i),
        })
    }
}

/// Spheres fixed to the chest frame: trunk, head, the arms' mounts, and the torso below, which is assumed upright.
#[derive(Debug, Clone, PartialEq)]
pub struct StillSpheres {
    /// Spheres in the chest frame.
    pub spheres: [Sphere; STILL_SPHERES],
}

impl StillSpheres {
    /// Creates the spheres of a robot.
    pub fn new(robot: &Robot) -> Self {
        let description = robot.description();
        let mut spheres = Vec::with_capacity(STILL_SPHERES);
        let mut add = |x: f64, y: f64, z: f64, radius: f64| {
            spheres.push(Sphere {
                centre: Vector3::new(x, y, z),
                radius,
            });
        };
        for y in [-0.1, 0.1] {
            add(0.0, y, 0.02, 0.19);
            add(0.0, y, -0.1, 0.19);
        }
        add(0.04, 0.0, description.neck.height + 0.11, 0.2);
        for part in 1..=5 {
            let below = description.torso.upper_length + description.torso.lower_length;
            add(
                0.0,
                0.0,
                -0.12 - f64::from(part) * (below - 0.12) / 5.0,
                0.13,
            );
        }
        for arm in 0..ARMS {
            let kinematics = robot.arm(arm);
            let base = kinematics.base().translation.vector;
            for share in [0.35, 0.75] {
                let centre = base + (kinematics.shoulder() - base) * share;
                add(centre.x, centre.y, centre.z, 0.11);
            }
        }
        Self {
            spheres: spheres
                .try_into()
                .expect("STILL_SPHERES spheres were added"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::safety::Bodies;
    use proptest::prelude::*;
    use tactnet_catching_packets::{JOINTS, joint};

    #[test]
    fn there_are_as_many_spheres_as_the_digest_proposes() {
        assert!((40..=60).contains(&(2 * ARM_SPHERES + STILL_SPHERES)));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn slopes_are_differences(q in proptest::array::uniform7(-2.0..2.0f64), arm in 0..ARMS, g in proptest::array::uniform3(-1.0..1.0f64)) {
            let robot = Robot::nominal();
            let spheres = ArmSpheres::new(&robot, arm);
            let gradient = Vector3::from(g);
            let chain = robot.arm(arm).chain(&q);
            for sphere in 0..ARM_SPHERES {
                let centre = spheres.centre(sphere, &chain);
                let slopes = spheres.slopes(sphere, &chain, &centre, &gradient);
                for i in 0..ARM_JOINTS {
                    let moved = |h: f64| {
                        let mut q = q;
                        q[i] += h;
                        spheres.centre(sphere, &robot.arm(arm).chain(&q)).dot(&gradient)
                    };
                    let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
                    prop_assert!((slope - slopes[i]).abs() < 1e-8, "{sphere} {i}: {slope} {}", slopes[i]);
                }
            }
        }

        /// The spheres contain the monitor's bodies of upper arm, forearm and hand, except for one centimetre between
        /// the fingers.
        #[test]
        fn spheres_hold_the_bodies_of_the_monitor(q in proptest::array::uniform7(-2.0..2.0f64), arm in 0..ARMS, to in proptest::array::uniform3(-1.0..1.0f64)) {
            let robot = Robot::nominal();
            let spheres = ArmSpheres::new(&robot, arm).placed(&robot, arm, &q);
            let mut whole = [0.0; JOINTS];
            whole[joint::ARM[arm].clone()].copy_from_slice(&q);
            let direction = Vector3::from(to);
            prop_assume!(direction.norm() > 0.1);
            let direction = direction.normalize();
            for hull in Bodies::new(robot.description()).arm(arm, &whole) {
                let farthest = hull.support(&direction).dot(&direction) + hull.radius;
                let held = spheres.iter().map(|sphere| sphere.centre.dot(&direction) + sphere.radius).fold(f64::NEG_INFINITY, f64::max);
                prop_assert!(farthest < held + 0.01, "{farthest} {held}");
            }
        }
    }
}
