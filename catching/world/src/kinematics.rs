//! Kinematics of the true robot as a tree of bodies: poses and velocities in the inertial frame.

use nalgebra::{Matrix3, Rotation3, Vector3};
use tactnet_catching_packets::{ARM_JOINTS, ARMS, JOINTS, Link, RobotDescription};

/// Number of bodies, each moved by one joint: platform; column, lower part, upper part, chest; neck, head; seven per
/// arm, left then right.
pub(crate) const BODIES: usize = 21;
/// Index of the chest, which the passive joint keeps upright.
pub(crate) const CHEST: usize = 4;
pub(crate) const HEAD: usize = 6;
/// Index of the last body of each arm.
pub(crate) const HAND: [usize; ARMS] = [13, 20];

/// A value for the joint of each body, in rad or m.
pub(crate) type Coordinates = [f64; BODIES];

/// Type and axis of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Axis {
    SlideY,
    TurnY,
    TurnMinusY,
    TurnZ,
}

/// A body and the joint that moves it.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    /// Index of the body that carries the joint; `None` for the first.
    pub(crate) parent: Option<usize>,
    /// Rotation from the joint's frame at 0 to the parent's frame.
    rotation: Matrix3<f64>,
    /// Origin of the joint in the parent's frame, in m.
    translation: Vector3<f64>,
    pub(crate) axis: Axis,
    /// Mass, in kg.
    pub(crate) mass: f64,
    /// Centre of mass in the body's frame, in m.
    pub(crate) centre: Vector3<f64>,
    /// Principal moments of inertia about the centre of mass, with axes parallel to the body's, in kg m^2.
    pub(crate) inertia: Vector3<f64>,
}

impl Body {
    /// Returns a body whose joint is at `translation` in the parent's frame, without rotation.
    fn on(parent: usize, axis: Axis, translation: Vector3<f64>, link: &Link) -> Self {
        Self {
            parent: Some(parent),
            rotation: Matrix3::identity(),
            translation,
            axis,
            mass: link.mass,
            centre: link.centre.into(),
            inertia: link.inertia.into(),
        }
    }
}

fn up(height: f64) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, height)
}

/// Returns platform, torso, neck and head, parents before children.
fn torso_and_head(robot: &RobotDescription) -> Vec<Body> {
    let (torso, neck) = (&robot.torso, &robot.neck);
    let [first, second, lower, upper] = &torso.links;
    let zero = Vector3::zeros();
    let platform = Body {
        parent: None,
        ..Body::on(0, Axis::SlideY, zero, &robot.platform.link)
    };
    vec![
        platform,
        Body::on(0, Axis::TurnZ, up(torso.lower_pitch_height), first),
        Body::on(1, Axis::TurnY, zero, second),
        Body::on(2, Axis::TurnY, up(torso.lower_length), lower),
        Body::on(3, Axis::TurnY, up(torso.upper_length), upper),
        Body::on(CHEST, Axis::TurnZ, up(neck.height), &neck.links[0]),
        Body::on(5, Axis::TurnY, zero, &neck.links[1]),
    ]
}

/// Pose of a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Position of its origin, in m.
    pub(crate) position: Vector3<f64>,
    /// Rotation from its frame to the inertial frame.
    pub(crate) rotation: Matrix3<f64>,
    /// Axis of its joint in the inertial frame.
    pub(crate) axis: Vector3<f64>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Velocity {
    /// Velocity of its origin, in m/s.
    pub(crate) linear: Vector3<f64>,
    /// Angular velocity, in rad/s.
    pub(crate) angular: Vector3<f64>,
}

/// All bodies, parents before children.
#[derive(Debug, Clone)]
pub(crate) struct Tree {
    pub(crate) bodies: [Body; BODIES],
    /// Distance from the last body of each arm to the catch frame along its z axis, in m.
    to_catch: [f64; ARMS],
}

impl Tree {
    /// Builds the tree. Each arm is displaced by `mount_errors` (chest frame, in m) from its place in the
    /// description.
    pub(crate) fn new(robot: &RobotDescription, mount_errors: &[Vector3<f64>; ARMS]) -> Self {
        let mut bodies = torso_and_head(robot);
        for (arm, error) in robot.arms.iter().zip(mount_errors) {
            let lean = Rotation3::from_axis_angle(&Vector3::x_axis(), arm.lean).into_inner();
            let shoulder = Vector3::from(arm.position) + error + lean * up(arm.base_to_shoulder);
            for joint in 0..ARM_JOINTS {
                let axis = match joint {
                    1 | 5 => Axis::TurnMinusY,
                    3 => Axis::TurnY,
                    _ => Axis::TurnZ,
                };
                let (parent, place) = match joint {
                    0 => (CHEST, shoulder),
                    3 => (bodies.len() - 1, up(arm.shoulder_to_elbow)),
                    5 => (bodies.len() - 1, up(arm.elbow_to_wrist)),
                    _ => (bodies.len() - 1, Vector3::zeros()),
                };
                let mut body = Body::on(parent, axis, place, &arm.links[joint]);
                if joint == 0 {
                    body.rotation = lean;
                }
                bodies.push(body);
            }
        }
        Self {
            bodies: bodies.try_into().expect("as many bodies as were counted"),
            to_catch: std::array::from_fn(|arm| robot.arms[arm].wrist_to_catch),
        }
    }

    /// Returns the tree of the described robot.
    #[cfg(test)]
    pub(crate) fn nominal() -> Self {
        Self::new(&RobotDescription::nominal(), &[Vector3::zeros(); ARMS])
    }

    pub(crate) fn places(&self, q: &Coordinates) -> [Place; BODIES] {
        let mut places = [Place {
            position: Vector3::zeros(),
            rotation: Matrix3::identity(),
            axis: Vector3::zeros(),
        }; BODIES];
        for (i, body) in self.bodies.iter().enumerate() {
            let (origin, parent) = match body.parent {
                Some(parent) => (places[parent].position, places[parent].rotation),
                None => (Vector3::zeros(), Matrix3::identity()),
            };
            let place = &mut places[i];
            place.position = origin + parent * body.translation;
            // Only the mounts of the arms are rotated.
            place.rotation = if body.parent == Some(CHEST) {
                parent * body.rotation
            } else {
                parent
            };
            let (sin, cos) = q[i].sin_cos();
            match body.axis {
                Axis::SlideY => {
                    place.axis = place.rotation.column(1).into_owned();
                    place.position += place.axis * q[i];
                }
                Axis::TurnY => {
                    place.axis = place.rotation.column(1).into_owned();
                    turn(&mut place.rotation, [2, 0], sin, cos);
                }
                Axis::TurnMinusY => {
                    place.axis = -place.rotation.column(1);
                    turn(&mut place.rotation, [2, 0], -sin, cos);
                }
                Axis::TurnZ => {
                    place.axis = place.rotation.column(2).into_owned();
                    turn(&mut place.rotation, [0, 1], sin, cos);
                }
            }
        }
        places
    }

    pub(crate) fn velocities(
        &self,
        places: &[Place; BODIES],
        dq: &Coordinates,
    ) -> [Velocity; BODIES] {
        let mut velocities = [Velocity {
            linear: Vector3::zeros(),
            angular: Vector3::zeros(),
        }; BODIES];
        for (i, body) in self.bodies.iter().enumerate() {
            let mut velocity = velocities[i];
            if let Some(parent) = body.parent {
                velocity.angular = velocities[parent].angular;
                velocity.linear = velocities[parent].linear
                    + velocity
                        .angular
                        .cross(&(places[i].position - places[parent].position));
            }
            match body.axis {
                Axis::SlideY => velocity.linear += places[i].axis * dq[i],
                _ => velocity.angular += places[i].axis * dq[i],
            }
            velocities[i] = velocity;
        }
        velocities
    }

    /// Returns the distance from an arm's wrist to its catch frame, in m.
    pub(crate) fn wrist_to_catch(&self, arm: usize) -> f64 {
        self.to_catch[arm]
    }

    /// Returns the origin of an arm's catch frame, in m. The rotation is that of the arm's last body.
    pub(crate) fn catch_position(&self, places: &[Place; BODIES], arm: usize) -> Vector3<f64> {
        let hand = &places[HAND[arm]];
        hand.position + hand.rotation.column(2) * self.to_catch[arm]
    }
}

/// Returns the values of all joints, including the passive one, which compensates both pitches. Valid for positions,
/// rates and accelerations.
pub(crate) fn with_passive(joints: &[f64; JOINTS]) -> Coordinates {
    std::array::from_fn(|i| match i {
        0..CHEST => joints[i],
        CHEST => -(joints[2] + joints[3]),
        _ => joints[i - 1],
    })
}

/// Returns the torques of the driven joints. The pitches carry the load of the passive joint, whose tendon does no
/// work.
pub(crate) fn without_passive(torques: &Coordinates) -> [f64; JOINTS] {
    std::array::from_fn(|i| match i {
        2 | 3 => torques[i] - torques[CHEST],
        0..CHEST => torques[i],
        _ => torques[i + 1],
    })
}

/// Rotates two axes of a frame within their plane, the first towards the second.
fn turn(rotation: &mut Matrix3<f64>, [first, second]: [usize; 2], sin: f64, cos: f64) {
    let [a, b] = [first, second].map(|axis| rotation.column(axis).into_owned());
    rotation.set_column(first, &(a * cos + b * sin));
    rotation.set_column(second, &(b * cos - a * sin));
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_chest_stays_upright(q in proptest::array::uniform20(-1.0..1.0f64)) {
            let places = Tree::nominal().places(&with_passive(&q));
            let up = places[CHEST].rotation.column(2).into_owned();
            prop_assert!((up - Vector3::z()).norm() < 1e-14);
        }

        #[test]
        fn velocities_are_the_derivatives_of_places(
            q in proptest::array::uniform20(-2.0..2.0f64),
            dq in proptest::array::uniform20(-2.0..2.0f64),
        ) {
            let tree = Tree::nominal();
            let h = 1e-6;
            let at = |t: f64| tree.places(&with_passive(&std::array::from_fn(|i| q[i] + dq[i] * t)));
            let (before, now, after) = (at(-h), at(0.0), at(h));
            let velocities = tree.velocities(&now, &with_passive(&dq));
            for i in 0..BODIES {
                let linear = (after[i].position - before[i].position) / (2.0 * h);
                let turned = (after[i].rotation - before[i].rotation) / (2.0 * h);
                let expected = velocities[i].angular.cross_matrix() * now[i].rotation;
                // Rounding error of central differences: 1e-16 / h.
                prop_assert!((linear - velocities[i].linear).norm() < 1e-7);
                prop_assert!((turned - expected).norm() < 1e-7);
            }
        }
    }

    /// With all joints at 0, the arms are straight along their inclined axes; expected values computed by hand from
    /// the lengths in the description.
    #[test]
    fn at_zero_the_robot_stands_as_described() {
        let robot = RobotDescription::nominal();
        let tree = Tree::nominal();
        let places = tree.places(&[0.0; BODIES]);
        assert!((places[CHEST].position - Vector3::new(0.0, 0.0, 1.2)).norm() < 1e-14);
        assert!((places[HEAD].position - Vector3::new(0.0, 0.0, 1.45)).norm() < 1e-14);
        let length = 0.3105 + 0.4 + 0.39 + 0.278;
        for arm in 0..ARMS {
            let lean = robot.arms[arm].lean;
            let expected = Vector3::new(0.0, robot.arms[arm].position[1], 1.2)
                + Vector3::new(0.0, -lean.sin(), lean.cos()) * length;
            assert!((tree.catch_position(&places, arm) - expected).norm() < 1e-14);
        }
    }
}
