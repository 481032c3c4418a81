//! The elastic torso: a spring and a damper between each torso drive and its link.
//!
//! `M_ee dde = -K e - D de - b`. `e` are the deflections of yaw and both pitches, `b` the torques of the prescribed
//! motion for `dde = 0` (one pass of Newton-Euler), and `M_ee` the inertia at the springs (three passes). The
//! deflection of a pitch moves the passive joint in the opposite direction, so the chest is displaced, but stays
//! upright.
//!
//! A step drifts half, kicks, and drifts half. It is of second order and symplectic without damping. Damping is
//! implicit.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::JOINTS;

use crate::dynamics::Inverse;
use crate::error::{WorldError, from_to, not_negative};
use crate::kinematics::{BODIES, Coordinates, Place, Tree, with_passive, without_passive};

/// Number of elastic joints: those of the torso.
pub(crate) const SPRINGS: usize = 3;

/// Stiffness of the torso.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Stiffness {
    /// Springs and dampers.
    Elastic,
    /// No springs: the links follow the drives exactly.
    Rigid,
}

tactnet_catching_packets::settings! {
    /// Settings of the springs of the torso.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct TorsoConfig in "torso.": WorldError {
        /// Elastic or rigid.
        pub stiffness: Stiffness = Stiffness::Elastic,
        /// Natural frequencies of yaw, lower and upper pitch in Hz, each with the inertia of that joint alone in the
        /// starting pose. The coupled pitches have one lower and one higher frequency.
        pub frequencies: [f64; 3] = [3.5, 4.0, 4.5] => from_to([f64::MIN_POSITIVE, 50.0], "more than 0 and at most 50 Hz, which substeps resolve"),
        /// Damping ratio.
        pub damping: f64 = 0.05 => not_negative,
    }
}

/// Motion of the joints as prescribed by the drives, without deflections.
pub(crate) struct Prescribed {
    pub(crate) q: [f64; JOINTS],
    pub(crate) dq: [f64; JOINTS],
    pub(crate) ddq: [f64; JOINTS],
}

/// Deflections of the torso.
#[derive(Debug, Clone)]
pub(crate) struct Torso {
    /// Stiffness in Nm/rad and damping in Nm s/rad; `None` for a rigid torso.
    springs: Option<(Vector3<f64>, Vector3<f64>)>,
    gravity: f64,
    /// Deflections of the links from the drives, in rad.
    pub(crate) e: Vector3<f64>,
    /// Rates of the deflections, in rad/s.
    pub(crate) de: Vector3<f64>,
    /// Accelerations of the deflections in the previous step, in rad/s^2.
    dde: Vector3<f64>,
}

impl Torso {
    /// Creates springs in equilibrium with the weight of a robot at rest at `start`.
    pub(crate) fn new(
        tree: &Tree,
        config: &TorsoConfig,
        gravity: f64,
        start: &[f64; JOINTS],
    ) -> Result<Self, WorldError> {
        let mut torso = Self {
            springs: None,
            gravity,
            e: Vector3::zeros(),
            de: Vector3::zeros(),
            dde: Vector3::zeros(),
        };
        if config.stiffness == Stiffness::Rigid {
            return Ok(torso);
        }
        let inertia = torso.inertia(tree, &tree.places(&with_passive(start))).0;
        let rates = Vector3::from(config.frequencies) * std::f64::consts::TAU;
        let stiffness = rates
            .component_mul(&rates)
            .component_mul(&inertia.diagonal());
        let damping = rates.component_mul(&inertia.diagonal()) * (2.0 * config.damping);
        torso.springs = Some((stiffness, damping));
        for _ in 0..200 {
            let places = tree.places(&deflected(start, &torso.e));
            let weight = tree.inverse_dynamics(&places, &[0.0; BODIES], &[0.0; BODIES], gravity);
            let balanced = -spring_torques(&weight.torques).component_div(&stiffness);
            let change = (balanced - torso.e).norm();
            torso.e = balanced;
            if change < 1e-14 {
                return Ok(torso);
            }
        }
        Err(WorldError::Collapses {
            frequencies: config.frequencies,
        })
    }

    /// Advances by `h`, with the drives at `middle` in the middle of the step. Returns torques, accelerations and
    /// poses of that time.
    ///
    /// - `braked`: true to hold the deflections
    pub(crate) fn advance(
        &mut self,
        tree: &Tree,
        middle: &Prescribed,
        h: f64,
        braked: bool,
    ) -> (Inverse, [Place; BODIES]) {
        if braked {
            (self.de, self.dde) = (Vector3::zeros(), Vector3::zeros());
        }
        self.e += self.de * (h / 2.0);
        // In the middle of the step, before the new acceleration is known.
        let rate = self.de + self.dde * (h / 2.0);
        let places = tree.places(&deflected(&middle.q, &self.e));
        let mut inverse = tree.inverse_dynamics(
            &places,
            &deflected(&middle.dq, &rate),
            &with_passive(&middle.ddq),
            self.gravity,
        );
        let Some((stiffness, damping)) = self.springs.filter(|_| !braked) else {
            return (inverse, places);
        };
        let (inertia, columns) = self.inertia(tree, &places);
        let torques = stiffness.component_mul(&self.e)
            + damping.component_mul(&self.de)
            + spring_torques(&inverse.torques);
        let implicit = inertia + Matrix3::from_diagonal(&(damping * (h / 2.0)));
        let factor = implicit
            .cholesky()
            .expect("an inertia matrix is positive definite");
        self.dde = -factor.solve(&torques);
        self.de += self.dde * h;
        self.e += self.de * (h / 2.0);
        for (column, dde) in columns.iter().zip(self.dde.iter()) {
            for i in 0..BODIES {
                inverse.torques[i] += column.torques[i] * dde;
                inverse.accelerations[i].specific_force +=
                    column.accelerations[i].specific_force * *dde;
                inverse.accelerations[i].angular += column.accelerations[i].angular * *dde;
            }
        }
        (inverse, places)
    }

    /// Returns the inertia at the springs in kg m^2, and the inverse dynamics for a unit acceleration of each
    /// deflection.
    fn inertia(&self, tree: &Tree, places: &[Place; BODIES]) -> (Matrix3<f64>, [Inverse; SPRINGS]) {
        let columns = std::array::from_fn(|spring| {
            let mut unit = Vector3::zeros();
            unit[spring] = 1.0;
            let ddq = deflected(&[0.0; JOINTS], &unit);
            tree.inverse_dynamics(places, &[0.0; BODIES], &ddq, 0.0)
        });
        let inertia = Matrix3::from_columns(
            &columns
                .each_ref()
                .map(|column: &Inverse| spring_torques(&column.torques)),
        );
        (inertia, columns)
    }
}

/// Returns the joints of all bodies, including the deflections of the torso.
pub(crate) fn deflected(joints: &[f64; JOINTS], e: &Vector3<f64>) -> Coordinates {
    let mut joints = *joints;
    for (joint, e) in joints[1..=SPRINGS].iter_mut().zip(e.iter()) {
        *joint += e;
    }
    with_passive(&joints)
}

fn spring_torques(torques: &Coordinates) -> Vector3<f64> {
    Vector3::from_column_slice(&without_passive(torques)[1..=SPRINGS])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GRAVITY;

    /// Bent arms and inclined torso: no symmetry.
    fn pose() -> [f64; JOINTS] {
        let mut q = [0.0; JOINTS];
        q[1..4].copy_from_slice(&[0.3, 0.2, -0.1]);
        q[6..13].copy_from_slice(&[0.4, 0.8, -0.3, 1.2, 0.2, 0.5, 0.0]);
        q[13..20].copy_from_slice(&[-0.2, 0.5, 0.6, 0.9, 0.1, -0.4, 0.0]);
        q
    }

    fn still(q: [f64; JOINTS]) -> Prescribed {
        let (dq, ddq) = ([0.0; JOINTS], [0.0; JOINTS]);
        Prescribed { q, dq, ddq }
    }

    #[test]
    fn springs_without_damping_keep_their_energy() {
        let tree = Tree::nominal();
        let config = TorsoConfig {
            damping: 0.0,
            ..TorsoConfig::default()
        };
        for gravity in [0.0, GRAVITY] {
            let mut torso = Torso::new(&tree, &config, gravity, &pose()).unwrap();
            let (stiffness, _) = torso.springs.unwrap();
            let rest = torso.e;
            let energy = |torso: &Torso| -> f64 {
                let places = tree.places(&deflected(&pose(), &torso.e));
                let rates = deflected(&[0.0; JOINTS], &torso.de);
                let springs = stiffness.component_mul(&torso.e).dot(&torso.e) / 2.0;
                springs + tree.energy(&places, &rates, gravity).iter().sum::<f64>()
            };
            let bottom = energy(&torso);
            torso.e += Vector3::new(0.03, 0.01, -0.015);
            let start = energy(&torso) - bottom;
            for _ in 0..10_000 {
                torso.advance(&tree, &still(pose()), 5e-4, false);
                let now = energy(&torso) - bottom;
                // Second order: (w h)^2 / 8 for the faster mode of both pitches, about 100 rad/s.
                assert!((now / start - 1.0).abs() < 2e-3, "{now} {start}");
            }
            assert!((torso.e - rest).norm() < 0.2);
        }
    }

    #[test]
    fn damping_brings_the_springs_to_rest_where_they_began() {
        let tree = Tree::nominal();
        let mut torso = Torso::new(&tree, &TorsoConfig::default(), GRAVITY, &pose()).unwrap();
        let rest = torso.e;
        for _ in 0..2000 {
            torso.advance(&tree, &still(pose()), 5e-4, false);
        }
        assert!((torso.e - rest).norm() < 1e-12, "balance");
        torso.de = Vector3::new(0.5, -0.2, 0.1);
        for _ in 0..20_000 {
            torso.advance(&tree, &still(pose()), 5e-4, false);
        }
        // The slower mode of both pitches decays with about 0.8 /s: e^-8 of 0.02 rad.
        let off = (torso.e - rest).norm();
        assert!(off < 2e-5, "{off}");
    }

    #[test]
    fn brakes_hold_the_deflections() {
        let tree = Tree::nominal();
        let mut torso = Torso::new(&tree, &TorsoConfig::default(), GRAVITY, &pose()).unwrap();
        torso.de = Vector3::new(0.5, -0.2, 0.1);
        let held = torso.e;
        let mut middle = still(pose());
        middle.ddq[7] = 15.0;
        let (inverse, _) = torso.advance(&tree, &middle, 5e-4, true);
        assert_eq!((torso.e, torso.de), (held, Vector3::zeros()));
        // The brakes carry the torques of the arm's acceleration.
        let (resting, _) = torso.advance(&tree, &still(pose()), 5e-4, true);
        let carried = spring_torques(&inverse.torques) - spring_torques(&resting.torques);
        assert!(carried.norm() > 1.0, "{carried}");
        torso.advance(&tree, &middle, 5e-4, false);
        assert!(torso.de.norm() > 1e-3);
    }

    #[test]
    fn the_yaw_spring_swings_with_its_frequency() {
        let tree = Tree::nominal();
        let config = TorsoConfig {
            damping: 0.0,
            ..TorsoConfig::default()
        };
        // In an upright and symmetric pose, yaw is decoupled from the pitches.
        let mut torso = Torso::new(&tree, &config, GRAVITY, &[0.0; JOINTS]).unwrap();
        torso.e.x = 0.01;
        let mut crossings = Vec::new();
        for step in 0..4000 {
            let before = torso.e.x;
            torso.advance(&tree, &still([0.0; JOINTS]), 5e-4, false);
            if before > 0.0 && torso.e.x <= 0.0 {
                crossings.push(f64::from(step) * 5e-4);
            }
        }
        let period = (crossings[5] - crossings[0]) / 5.0;
        // Zero crossings are accurate to a substep: 5e-4 s in five periods.
        assert!((period - 1.0 / 3.5).abs() < 3e-4, "{period}");
    }

    #[test]
    fn springs_carry_what_newton_and_euler_ask_of_them() {
        let tree = Tree::nominal();
        let mut torso = Torso::new(&tree, &TorsoConfig::default(), GRAVITY, &pose()).unwrap();
        let mut middle = still(pose());
        middle.ddq[7] = 15.0;
        for _ in 0..20 {
            let (stiffness, damping) = torso.springs.unwrap();
            let before = torso.de;
            let (inverse, _) = torso.advance(&tree, &middle, 5e-4, false);
            let e = torso.e - torso.de * 2.5e-4;
            let de = (before + torso.de) / 2.0;
            let spring = -(stiffness.component_mul(&e) + damping.component_mul(&de));
            // Rounding errors of torques of 100 Nm.
            assert!((spring_torques(&inverse.torques) - spring).norm() < 1e-9);
        }
    }

    #[test]
    fn springs_too_weak_for_the_robot_are_an_error() {
        let config = TorsoConfig {
            frequencies: [3.5, 0.2, 0.2],
            ..TorsoConfig::default()
        };
        let found = Torso::new(&Tree::nominal(), &config, GRAVITY, &pose());
        assert!(matches!(found, Err(WorldError::Collapses { .. })));
    }
}
