//! Inverse dynamics by recursive Newton-Euler in the inertial frame.
//!
//! The outward pass computes rate, angular acceleration and acceleration of every body. The inward pass computes the
//! force and moment at each joint (Luh, Walker and Paul 1980). Gravity enters as an upward acceleration of the
//! ground, so accelerations here are specific forces.

use nalgebra::Vector3;

use crate::kinematics::{Axis, BODIES, Coordinates, Place, Tree};

/// Acceleration state of a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Acceleration {
    /// Acceleration of the origin minus gravity, in m/s^2.
    pub(crate) specific_force: Vector3<f64>,
    /// Angular acceleration, in rad/s^2.
    pub(crate) angular: Vector3<f64>,
    /// Angular velocity, in rad/s.
    pub(crate) rate: Vector3<f64>,
}

/// Result of the inverse dynamics.
#[derive(Debug, Clone)]
pub(crate) struct Inverse {
    /// Joint torques in Nm, or forces in N for sliding joints.
    pub(crate) torques: Coordinates,
    /// Acceleration state of every body.
    pub(crate) accelerations: [Acceleration; BODIES],
}

impl Tree {
    /// Returns the torques for a motion with rates `dq` and accelerations `ddq` of the robot at `places`.
    ///
    /// `gravity` points down, in m/s^2. With rates and gravity 0 and one acceleration 1, the torques are that joint's
    /// column of the inertia matrix.
    pub(crate) fn inverse_dynamics(
        &self,
        places: &[Place; BODIES],
        dq: &Coordinates,
        ddq: &Coordinates,
        gravity: f64,
    ) -> Inverse {
        let ground = Acceleration {
            specific_force: Vector3::new(0.0, 0.0, gravity),
            angular: Vector3::zeros(),
            rate: Vector3::zeros(),
        };
        let mut accelerations = [ground; BODIES];
        let mut forces = [Vector3::zeros(); BODIES];
        let mut moments = [Vector3::zeros(); BODIES];
        for (i, body) in self.bodies.iter().enumerate() {
            let place = &places[i];
            let (carrier, arm) = match body.parent {
                Some(parent) => (
                    accelerations[parent],
                    place.position - places[parent].position,
                ),
                None => (ground, place.position),
            };
            let mut a = Acceleration {
                specific_force: carrier.specific_force
                    + carrier.angular.cross(&arm)
                    + carrier.rate.cross(&carrier.rate.cross(&arm)),
                ..carrier
            };
            let joint_rate = place.axis * dq[i];
            if body.axis == Axis::SlideY {
                a.specific_force += place.axis * ddq[i] + carrier.rate.cross(&joint_rate) * 2.0;
            } else {
                a.rate += joint_rate;
                a.angular += place.axis * ddq[i] + carrier.rate.cross(&joint_rate);
            }
            let centre = place.rotation * body.centre;
            let force = (a.specific_force
                + a.angular.cross(&centre)
                + a.rate.cross(&a.rate.cross(&centre)))
                * body.mass;
            let inertia = |x: &Vector3<f64>| {
                place.rotation * place.rotation.tr_mul(x).component_mul(&body.inertia)
            };
            forces[i] = force;
            moments[i] =
                inertia(&a.angular) + a.rate.cross(&inertia(&a.rate)) + centre.cross(&force);
            accelerations[i] = a;
        }
        let mut torques = [0.0; BODIES];
        for (i, body) in self.bodies.iter().enumerate().rev() {
            torques[i] = match body.axis {
                Axis::SlideY => places[i].axis.dot(&forces[i]),
                _ => places[i].axis.dot(&moments[i]),
            };
            if let Some(parent) = body.parent {
                let arm = places[i].position - places[parent].position;
                let moment = moments[i] + arm.cross(&forces[i]);
                let force = forces[i];
                forces[parent] += force;
                moments[parent] += moment;
            }
        }
        Inverse {
            torques,
            accelerations,
        }
    }

    /// Returns kinetic and potential energy, in J.
    #[cfg(test)]
    pub(crate) fn energy(
        &self,
        places: &[Place; BODIES],
        dq: &Coordinates,
        gravity: f64,
    ) -> [f64; 2] {
        let velocities = self.velocities(places, dq);
        let mut energy = [0.0; 2];
        for (i, body) in self.bodies.iter().enumerate() {
            let place = &places[i];
            let centre = place.rotation * body.centre;
            let v = velocities[i].linear + velocities[i].angular.cross(&centre);
            let w = place.rotation.tr_mul(&velocities[i].angular);
            energy[0] +=
                0.5 * body.mass * v.norm_squared() + 0.5 * w.component_mul(&w).dot(&body.inertia);
            energy[1] += body.mass * gravity * (place.position + centre).z;
        }
        energy
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GRAVITY;
    use crate::kinematics::{HAND, HEAD, with_passive, without_passive};
    use proptest::prelude::*;
    use tactnet_catching_packets::JOINTS;

    fn along(
        q: &[f64; JOINTS],
        dq: &[f64; JOINTS],
        ddq: &[f64; JOINTS],
        t: f64,
    ) -> [Coordinates; 2] {
        [
            with_passive(&std::array::from_fn(|i| {
                q[i] + dq[i] * t + ddq[i] * t * t / 2.0
            })),
            with_passive(&std::array::from_fn(|i| dq[i] + ddq[i] * t)),
        ]
    }

    proptest! {
        #[test]
        fn the_power_of_the_joints_is_the_change_of_energy(
            q in proptest::array::uniform20(-1.5..1.5f64),
            dq in proptest::array::uniform20(-2.0..2.0f64),
            ddq in proptest::array::uniform20(-20.0..20.0f64),
        ) {
            let tree = Tree::nominal();
            let places = tree.places(&with_passive(&q));
            let found = tree.inverse_dynamics(&places, &with_passive(&dq), &with_passive(&ddq), GRAVITY);
            let torques = without_passive(&found.torques);
            let power: f64 = torques.iter().zip(&dq).map(|(tau, dq)| tau * dq).sum();
            let h = 1e-5;
            let energy = |t: f64| -> f64 {
                let [q, dq] = along(&q, &dq, &ddq, t);
                tree.energy(&tree.places(&q), &dq, GRAVITY).iter().sum()
            };
            let change = (energy(h) - energy(-h)) / (2.0 * h);
            // Central differences of about 1 kJ: rounding errors of 1e3 x 1e-16 / h, and h^2 times the third
            // derivative.
            prop_assert!((power - change).abs() < 1e-4 * (1.0 + power.abs()), "{power} {change}");
        }

        #[test]
        fn the_platforms_force_is_the_change_of_sideways_momentum(
            q in proptest::array::uniform20(-1.5..1.5f64),
            dq in proptest::array::uniform20(-2.0..2.0f64),
            ddq in proptest::array::uniform20(-20.0..20.0f64),
        ) {
            let tree = Tree::nominal();
            let places = tree.places(&with_passive(&q));
            let found = tree.inverse_dynamics(&places, &with_passive(&dq), &with_passive(&ddq), GRAVITY);
            let h = 1e-5;
            let momentum = |t: f64| -> f64 {
                let [q, dq] = along(&q, &dq, &ddq, t);
                let places = tree.places(&q);
                let velocities = tree.velocities(&places, &dq);
                (0..BODIES)
                    .map(|i| {
                        let centre = places[i].rotation * tree.bodies[i].centre;
                        tree.bodies[i].mass
                            * (velocities[i].linear + velocities[i].angular.cross(&centre)).y
                    })
                    .sum()
            };
            let change = (momentum(h) - momentum(-h)) / (2.0 * h);
            // As above, for momenta of about 100 kg m/s.
            prop_assert!((found.torques[0] - change).abs() < 1e-4 * (1.0 + change.abs()));
        }
    }

    /// Values of `tests/golden/catching_dynamics_with_pinocchio.py`, where Pinocchio and MuJoCo agree to 1e-9.
    #[test]
    fn torques_and_places_are_those_of_pinocchio() {
        let golden: serde_json::Value = serde_json::from_str(include_str!(
            "../../../tests/golden/catching_dynamics_with_pinocchio.json"
        ))
        .unwrap();
        let numbers = |value: &serde_json::Value| -> Vec<f64> {
            let numbers = value.as_array().unwrap().iter();
            numbers.map(|x| x.as_f64().unwrap()).collect()
        };
        let tree = Tree::nominal();
        let cases = golden["cases"].as_array().unwrap();
        assert!(cases.len() >= 5);
        for case in cases {
            let [q, dq, ddq]: [Coordinates; 3] =
                ["q", "dq", "ddq"].map(|name| numbers(&case[name]).try_into().unwrap());
            let places = tree.places(&q);
            let found = tree.inverse_dynamics(&places, &dq, &ddq, GRAVITY);
            for (i, expected) in numbers(&case["tau"]).iter().enumerate() {
                // Torques reach 1e3 to 1e4, so 1e-8 is a hundred times their rounding error.
                let off = found.torques[i] - expected;
                assert!(off.abs() < 1e-8, "{i}: {off}");
            }
            for (name, body, position) in [
                ("head", HEAD, places[HEAD].position),
                ("left", HAND[0], tree.catch_position(&places, 0)),
                ("right", HAND[1], tree.catch_position(&places, 1)),
            ] {
                let expected = numbers(&case[name]["position"]);
                // Lengths of a metre through ten rotations: rounding errors of some 1e-16 each.
                assert!((position - Vector3::from_row_slice(&expected)).norm() < 1e-13);
                let expected = numbers(&case[name]["rotation"]);
                let expected = nalgebra::Matrix3::from_row_slice(&expected);
                assert!((places[body].rotation - expected).norm() < 1e-13);
            }
        }
    }
}
