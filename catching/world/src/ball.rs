//! Flight and bounce of a ball.
//!
//! `(m + m_a) dv/dt = -(m - m_b) g e_z - 1/2 rho C_d A |v| v + 1/2 rho A C_L |v|^2 (w/|w| x v/|v|)`
//!
//! with `m_b` the mass of the displaced air, `m_a = m_b / 2` the added mass of a sphere (potential flow), and `C_L`
//! the lift coefficient of the Magnus effect, `min(slope R |w| / |v|, limit)`. Lift proportional to the spin
//! parameter `R |w| / |v|` is the usual fit for sports balls (Goff and Carre 2009 for soccer balls). Smooth spheres
//! have less or even negative lift, so the default slope is small; it is an assumption.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, UnitSphere};
use serde::{Deserialize, Serialize};

use crate::GRAVITY;
use crate::error::{WorldError, not_negative, positive, probability, rising};

/// Maximum integration step in flight, in s.
pub(crate) const BALL_STEP: f64 = 1e-4;

tactnet_catching_packets::settings! {
    /// Properties of balls and air.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct BallConfig in "ball.": WorldError {
        /// Radius, in m.
        pub radius: f64 = 0.0425 => positive,
        /// Mass, in kg.
        pub mass: f64 = 0.05 => positive,
        /// Density of the air, in kg/m^3; 0 disables drag, lift and buoyancy.
        pub air: f64 = 1.2 => not_negative,
        /// Minimum and maximum drag coefficient; drawn uniformly for each ball.
        pub drag: [f64; 2] = [0.40, 0.55] => rising(0.0, "[least, greatest], 0 or greater"),
        /// Minimum and maximum spin, in rotations per second; the axis has a random direction.
        pub spin: [f64; 2] = [0.0, 5.0] => rising(0.0, "[least, greatest], 0 or greater"),
        /// Lift coefficient divided by `R |w| / |v|`.
        pub lift_slope: f64 = 0.25 => not_negative,
        /// Maximum lift coefficient.
        pub lift_limit: f64 = 0.2 => not_negative,
        /// Ratio of the vertical speeds after and before a bounce on the floor.
        pub restitution: f64 = 0.7 => probability,
    }
}

/// Position and velocity of a ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BallState {
    /// Position of the centre, m.
    pub position: Vector3<f64>,
    /// Velocity of the centre, in m/s.
    pub velocity: Vector3<f64>,
}

/// Coefficients of the equation of motion of one ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Aerodynamics {
    /// Gravity minus buoyancy per effective mass, in m/s^2.
    gravity: f64,
    pub(crate) coefficient: f64,
    /// Drag per effective mass, in 1/m.
    drag: f64,
    /// Maps the velocity to the acceleration by lift below the limit, in 1/s.
    lift: Vector3<f64>,
    /// Maximum lift per effective mass, in 1/m.
    lift_limit: f64,
    pub(crate) radius: f64,
    /// Angular velocity at the release, in rad/s.
    pub(crate) spin: Vector3<f64>,
    restitution: f64,
}

impl Aerodynamics {
    /// Draws drag and spin of a ball.
    pub(crate) fn draw(config: &BallConfig, rng: &mut ChaCha8Rng) -> Self {
        let drag = config.drag[0] + (config.drag[1] - config.drag[0]) * rng.random::<f64>();
        let rotations = config.spin[0] + (config.spin[1] - config.spin[0]) * rng.random::<f64>();
        let axis: [f64; 3] = UnitSphere.sample(rng);
        let spin = Vector3::from(axis) * (rotations * std::f64::consts::TAU);
        Self::new(config, drag, spin)
    }

    /// Returns a ball with a given drag coefficient and spin in rad/s.
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
            spin,
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

    /// Returns the ball `h` seconds later, by one Runge-Kutta step of fourth order without floor.
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

    /// Returns the ball after [`BALL_STEP`], and true if it bounced on the floor at height 0.
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
        // Rounding errors of 8000 steps.
        assert!((ball.position - expected).norm() < 1e-11);
    }

    /// Values of the digest: k = 0.0320 /m minus 0.39 % for the added mass, effective gravity 9.70 m/s^2.
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
        // For a flight along -x, topspin is a rotation about -y.
        let spin = |size: f64| Vector3::new(0.0, -size, 0.0);
        let height = |size: f64| fly(&config, 0.47, spin(size), 0.8, BALL_STEP).position.z;
        let drop = height(0.0) - height(10.0 * std::f64::consts::PI);
        // At five rotations per second: half of 0.16 m/s^2 times 0.64 s^2.
        assert!((0.02..0.08).contains(&drop), "{drop}");
        assert!((height(1e4) - height(1e5)).abs() < 1e-12);
    }

    #[test]
    fn the_step_is_short_enough() {
        let config = BallConfig::default();
        let spin = Vector3::new(10.0, -20.0, 5.0);
        let fine = fly(&config, 0.5, spin, 0.8, BALL_STEP / 4.0);
        let used = fly(&config, 0.5, spin, 0.8, BALL_STEP);
        // A method of fourth order with a step of 1e-4 s leaves only rounding errors.
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
