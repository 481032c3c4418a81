//! How a ball flies and bounces.
//!
//! `(m + m_a) dv/dt = -(m - m_b) g e_z - 1/2 rho C_d A |v| v + 1/2 rho A C_L |v|^2 (w/|w| x v/|v|)`
//!
//! with `m_b` the mass of the displaced air, `m_a = m_b / 2` the air that a sphere takes along (potential flow), and `C_L` the Magnus
//! effect's: `min(slope R |w| / |v|, limit)`. Lift proportional to the spin parameter `R |w| / |v|` is the usual fit for sports balls (Goff
//! and Carre 2009 measure it for soccer balls); smooth spheres lift less and may even turn round, so our slope is small, and assumed.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitSphere};
use serde::{Deserialize, Serialize};

use crate::GRAVITY;
use crate::error::{WorldError, not_negative, positive, probability, range};

/// Longest step in flight, s.
pub(crate) const BALL_STEP: f64 = 1e-4;

/// The balls and the air.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BallConfig {
    /// m.
    pub radius: f64,
    /// kg.
    pub mass: f64,
    /// Density of the air, kg/m^3; 0 for none.
    pub air: f64,
    /// Drag coefficient: least and greatest; each ball's is drawn evenly between.
    pub drag: [f64; 2],
    /// Rotations a second: least and greatest; about an axis of any direction.
    pub spin: [f64; 2],
    /// Lift coefficient per `R |w| / |v|`.
    pub lift_slope: f64,
    /// Greatest lift coefficient.
    pub lift_limit: f64,
    /// Part of the vertical speed that a bounce on the floor leaves.
    pub restitution: f64,
}

impl Default for BallConfig {
    fn default() -> Self {
        Self {
            radius: 0.0425,
            mass: 0.05,
            air: 1.2,
            drag: [0.40, 0.55],
            spin: [0.0, 5.0],
            lift_slope: 0.25,
            lift_limit: 0.2,
            restitution: 0.7,
        }
    }
}

impl BallConfig {
    pub(crate) fn check(&self) -> Result<(), WorldError> {
        positive("ball.radius", self.radius)?;
        positive("ball.mass", self.mass)?;
        not_negative("ball.air", self.air)?;
        let expected = "[least, greatest], 0 or greater";
        range("ball.drag", self.drag, 0.0, expected)?;
        range("ball.spin", self.spin, 0.0, expected)?;
        not_negative("ball.lift_slope", self.lift_slope)?;
        not_negative("ball.lift_limit", self.lift_limit)?;
        probability("ball.restitution", self.restitution)
    }
}

/// Where a ball is and where it goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallState {
    /// Position of the centre, m.
    pub position: Vector3<f64>,
    /// m/s.
    pub velocity: Vector3<f64>,
}

/// What acts on one ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aerodynamics {
    /// Gravity less buoyancy, over the mass with the air taken along, m/s^2.
    gravity: f64,
    /// Drag coefficient.
    pub(crate) coefficient: f64,
    /// 1/m.
    drag: f64,
    /// Turns the velocity into an acceleration where lift is not at its limit, 1/s.
    lift: Vector3<f64>,
    /// Greatest lift, 1/m.
    lift_limit: f64,
    pub(crate) radius: f64,
    restitution: f64,
}

impl Aerodynamics {
    /// Draws a ball's drag and spin.
    pub(crate) fn draw(config: &BallConfig, rng: &mut ChaCha8Rng) -> Self {
        let drag = config.drag[0] + (config.drag[1] - config.drag[0]) * rng.random::<f64>();
        let rotations = config.spin[0] + (config.spin[1] - config.spin[0]) * rng.random::<f64>();
        let axis: [f64; 3] = UnitSphere.sample(rng);
        let spin = Vector3::from(axis) * (rotations * std::f64::consts::TAU);
        Self::new(config, drag, spin)
    }

    /// Returns a ball with a drag coefficient and a spin, rad/s.
    pub(crate) fn new(config: &BallConfig, drag: f64, spin: Vector3<f64>) -> Self {
        let area = std::f64::consts::PI * config.radius.powi(2);
        let displaced = config.air * 4.0 / 3.0 * area * config.radius;
        let mass = config.mass + displaced / 2.0;
        let pressure = config.air * area / (2.0 * mass);
        Self {
            coefficient: drag,
            gravity: GRAVITY * (config.mass - displaced) / mass,
            drag: pressure * drag,
            lift: spin * (pressure * config.lift_slope * config.radius),
            lift_limit: pressure * config.lift_limit,
            radius: config.radius,
            restitution: config.restitution,
        }
    }

    fn acceleration(&self, v: &Vector3<f64>) -> Vector3<f64> {
        let speed = v.norm();
        let lift = self.lift.norm();
        // At the limit, `C_L` no longer grows with the spin.
        let limited = if lift > self.lift_limit * speed {
            self.lift_limit * speed / lift
        } else {
            1.0
        };
        self.lift.cross(v) * limited - v * (self.drag * speed) - Vector3::z() * self.gravity
    }

    /// Returns a flying ball `h` seconds later: one step of Runge-Kutta of fourth order, no floor.
    pub(crate) fn fly(&self, ball: &BallState, h: f64) -> BallState {
        let v1 = ball.velocity;
        let a1 = self.acceleration(&v1);
        let v2 = v1 + a1 * (h / 2.0);
        let a2 = self.acceleration(&v2);
        let v3 = v1 + a2 * (h / 2.0);
        let a3 = self.acceleration(&v3);
        let v4 = v1 + a3 * h;
        let a4 = self.acceleration(&v4);
        BallState {
            position: ball.position + (v1 + (v2 + v3) * 2.0 + v4) * (h / 6.0),
            velocity: v1 + (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0),
        }
    }

    /// Returns the ball [`BALL_STEP`] later, and whether it touched the floor (height 0), from which it bounces.
    pub(crate) fn step(&self, ball: &BallState) -> (BallState, bool) {
        let mut next = self.fly(ball, BALL_STEP);
        let below = self.radius - next.position.z;
        if below <= 0.0 || next.velocity.z >= 0.0 {
            return (next, false);
        }
        next.position.z = self.radius + below * self.restitution;
        next.velocity.z *= -self.restitution;
        (next, true)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const THROWN: BallState = BallState {
        position: Vector3::new(5.0, 0.0, 1.5),
        velocity: Vector3::new(-6.0, 0.0, 3.5),
    };

    fn fly(config: &BallConfig, drag: f64, spin: Vector3<f64>, seconds: f64, h: f64) -> BallState {
        let air = Aerodynamics::new(config, drag, spin);
        (0..(seconds / h).round() as usize).fold(THROWN, |ball, _| air.fly(&ball, h))
    }

    #[test]
    fn without_air_a_ball_flies_a_parabola() {
        let config = BallConfig {
            air: 0.0,
            ..BallConfig::default()
        };
        let ball = fly(&config, 0.47, Vector3::new(0.0, 30.0, 0.0), 0.8, BALL_STEP);
        let expected = THROWN.position + THROWN.velocity * 0.8
            - Vector3::new(0.0, 0.0, GRAVITY * 0.8 * 0.8 / 2.0);
        // Rounding of 8000 steps.
        assert!((ball.position - expected).norm() < 1e-11);
    }

    /// The digest's numbers: k = 0.0320 /m less 0.39 % for the air taken along, effective gravity 9.70 m/s^2.
    #[test]
    fn drag_and_effective_gravity_are_those_of_the_digest() {
        let air = Aerodynamics::new(&BallConfig::default(), 0.47, Vector3::zeros());
        assert!((air.drag - 0.0320 / 1.0039).abs() < 1e-4, "{}", air.drag);
        assert!((air.gravity - 9.70).abs() < 5e-3, "{}", air.gravity);
    }

    #[test]
    fn drag_costs_a_throw_of_five_metres_more_than_twenty_centimetres() {
        let config = BallConfig::default();
        let with = fly(&config, 0.47, Vector3::zeros(), 0.8, BALL_STEP);
        let without = fly(&config, 0.0, Vector3::zeros(), 0.8, BALL_STEP);
        let short = with.position.x - without.position.x;
        assert!((0.2..0.6).contains(&short), "{short}");
    }

    #[test]
    fn topspin_pulls_a_ball_down_and_never_beyond_the_lifts_limit() {
        let config = BallConfig::default();
        // Flying to -x, the top moves forward about -y.
        let spin = |size: f64| Vector3::new(0.0, -size, 0.0);
        let height = |size: f64| fly(&config, 0.47, spin(size), 0.8, BALL_STEP).position.z;
        let drop = height(0.0) - height(10.0 * std::f64::consts::PI);
        // At five rotations a second; half of 0.16 m/s^2 times 0.64 s^2.
        assert!((0.02..0.08).contains(&drop), "{drop}");
        assert!((height(1e4) - height(1e5)).abs() < 1e-12);
    }

    #[test]
    fn the_step_is_short_enough() {
        let config = BallConfig::default();
        let spin = Vector3::new(10.0, -20.0, 5.0);
        let fine = fly(&config, 0.5, spin, 0.8, BALL_STEP / 4.0);
        let used = fly(&config, 0.5, spin, 0.8, BALL_STEP);
        // Fourth order at 1e-4 s leaves nothing but rounding.
        assert!((fine.position - used.position).norm() < 1e-11);
    }

    #[test]
    fn a_bounce_leaves_the_restitution_of_the_speed() {
        let air = Aerodynamics::new(&BallConfig::default(), 0.47, Vector3::zeros());
        let mut ball = BallState {
            position: Vector3::new(0.0, 0.0, 0.0426),
            velocity: Vector3::new(1.0, 0.0, -4.0),
        };
        let bounced = std::iter::from_fn(|| {
            let (next, bounced) = air.step(&ball);
            ball = next;
            Some(bounced)
        });
        assert_eq!(bounced.take(10).filter(|b| *b).count(), 1);
        assert!((ball.velocity.z - 2.8).abs() < 0.02, "{}", ball.velocity.z);
        assert!(ball.position.z > 0.0425);
    }
}
