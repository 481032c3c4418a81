//! Flight of a ball with gravity, buoyancy, added mass, drag and lift of its spin: `dv/dt = g - k |v| v + lift x v`.

use nalgebra::{Isometry3, Point3, Vector3};
use tactnet_catching_packets::packets::{BallPrediction, FlightPacket};

/// Effective gravity with buoyancy and added mass of the ball (8.5 cm, 50 g), in m/s^2: 9.81 x (1 - 0.0077) / (1 +
/// 0.0039).
pub const GRAVITY: f64 = 9.697;
/// Drag coefficient of a smooth sphere of that size and mass at a Reynolds number of 4e4, in 1/m: `rho C_d A / (2 m)`
/// with `C_d` = 0.47.
pub const DRAG: f64 = 0.0320;
/// Radius of the ball, in m.
pub const BALL_RADIUS: f64 = 0.0425;
/// Maximum integration step, in s. The error over a throw of one second stays below 1 um.
pub const STEP: f64 = 0.01;

/// State of a ball at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Flight {
    /// Position of the centre, in m.
    pub p: Vector3<f64>,
    /// Velocity, in m/s.
    pub v: Vector3<f64>,
    /// Drag coefficient, in 1/m.
    pub k: f64,
    /// Lift vector along the axis of rotation, in 1/s. For this ball it is 7e-4 times the angular velocity in rad/s.
    pub lift: Vector3<f64>,
}

impl Flight {
    /// Returns a ball without spin.
    ///
    /// - `p`: position, in m
    /// - `v`: velocity, in m/s
    /// - `k`: drag coefficient, in 1/m
    pub fn without_spin(p: Vector3<f64>, v: Vector3<f64>, k: f64) -> Self {
        Self {
            p,
            v,
            k,
            lift: Vector3::zeros(),
        }
    }

    /// Returns the flight of a prediction at its time.
    pub fn of(ball: &BallPrediction) -> Self {
        Self {
            p: ball.p.into(),
            v: ball.v.into(),
            k: ball.k,
            lift: ball.lift.into(),
        }
    }

    /// Returns the flight of a packet at its time.
    pub fn of_packet(packet: &FlightPacket) -> Self {
        Self {
            p: packet.p.into(),
            v: packet.v.into(),
            k: packet.k,
            lift: packet.lift.into(),
        }
    }

    /// Returns the flight as a packet for time `t_ns`.
    pub fn packet(&self, t_ns: u64) -> FlightPacket {
        FlightPacket {
            t_ns,
            p: self.p.into(),
            v: self.v.into(),
            k: self.k,
            lift: self.lift.into(),
        }
    }

    /// Returns the flight in another frame.
    pub(crate) fn in_frame(&self, to_frame: &Isometry3<f64>) -> Self {
        Self {
            p: (to_frame * Point3::from(self.p)).coords,
            v: to_frame.rotation * self.v,
            k: self.k,
            lift: to_frame.rotation * self.lift,
        }
    }

    /// Returns the acceleration, in m/s^2.
    pub fn acceleration(&self) -> Vector3<f64> {
        acceleration(&self.v, self.k, &self.lift)
    }

    /// Returns the ball `dt` seconds later (earlier if negative), integrated with the fourth-order Runge-Kutta method.
    pub fn after(&self, dt: f64) -> Self {
        let steps = (dt.abs() / STEP).ceil().max(1.0);
        let h = dt / steps;
        (0..steps as usize).fold(*self, |flight, _| flight.step(h))
    }

    fn step(&self, h: f64) -> Self {
        let a1 = acceleration(&self.v, self.k, &self.lift);
        let v2 = self.v + a1 * (h / 2.0);
        let a2 = acceleration(&v2, self.k, &self.lift);
        let v3 = self.v + a2 * (h / 2.0);
        let a3 = acceleration(&v3, self.k, &self.lift);
        let v4 = self.v + a3 * h;
        let a4 = acceleration(&v4, self.k, &self.lift);
        Self {
            p: self.p + (self.v + (v2 + v3) * 2.0 + v4) * (h / 6.0),
            v: self.v + (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0),
            k: self.k,
            lift: self.lift,
        }
    }
}

fn acceleration(v: &Vector3<f64>, k: f64, lift: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -GRAVITY) - v * (k * v.norm()) + lift.cross(v)
}

/// Maximum number of knots of a [`FlightPath`].
const KNOTS: usize = 200;

/// Flight over the next two seconds, integrated once and evaluated at any time.
#[derive(Debug, Clone)]
pub struct FlightPath {
    knots: [Flight; KNOTS],
}

impl FlightPath {
    /// Integrates from `start` at time 0. Does not allocate.
    pub fn new(start: Flight) -> Self {
        Self::recorded(&[start])
    }

    /// Creates a path from recorded states, one per 10 ms from time 0. After the last one, the ball flies on.
    ///
    /// # Panics
    /// Panics without a state.
    pub fn recorded(recorded: &[Flight]) -> Self {
        let mut knots = [recorded[0]; KNOTS];
        for i in 1..KNOTS {
            knots[i] = recorded
                .get(i)
                .copied()
                .unwrap_or_else(|| knots[i - 1].step(STEP));
        }
        Self { knots }
    }

    /// Returns the ball at time `t`, in s. Outside of the path, it is integrated from the nearest knot.
    pub fn at(&self, t: f64) -> Flight {
        let i = ((t / STEP).round().max(0.0) as usize).min(KNOTS - 1);
        let dt = t - i as f64 * STEP;
        if dt.abs() <= STEP {
            self.knots[i].step(dt)
        } else {
            self.knots[i].after(dt)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn thrown() -> impl Strategy<Value = Flight> {
        (
            proptest::array::uniform3(-5.0..5.0f64),
            proptest::array::uniform3(-8.0..8.0f64),
            0.0..0.06f64,
            proptest::array::uniform3(-0.03..0.03f64),
        )
            .prop_map(|(p, v, k, lift)| Flight {
                p: p.into(),
                v: v.into(),
                k,
                lift: lift.into(),
            })
    }

    proptest! {
        #[test]
        fn without_air_a_ball_flies_a_parabola(mut ball in thrown(), t in 0.0..1.5f64) {
            (ball.k, ball.lift) = (0.0, Vector3::zeros());
            let expected = ball.p + ball.v * t - Vector3::new(0.0, 0.0, GRAVITY * t * t / 2.0);
            prop_assert!((ball.after(t).p - expected).norm() < 1e-12);
        }

        #[test]
        fn energy_falls_with_drag(ball in thrown(), t in 0.01..1.5f64) {
            let energy = |b: &Flight| b.v.norm_squared() / 2.0 + GRAVITY * b.p.z;
            let after = ball.after(t);
            prop_assert!(energy(&after) <= energy(&ball) + 1e-9);
        }

        #[test]
        fn time_runs_backwards(ball in thrown(), t in 0.01..1.0f64) {
            let back = ball.after(t).after(-t);
            // Twice the step's error of fifth order.
            prop_assert!((back.p - ball.p).norm() < 1e-7, "{}", (back.p - ball.p).norm());
        }

        #[test]
        fn a_path_is_the_flight(ball in thrown(), t in -0.05..2.2f64) {
            let path = FlightPath::new(ball);
            prop_assert!((path.at(t).p - ball.after(t).p).norm() < 1e-7);
            prop_assert!((path.at(t).v - ball.after(t).v).norm() < 1e-6);
        }
    }

    /// Topspin of a ball that flies along -x is a rotation about -y.
    #[test]
    fn lift_bends_a_flight_across_velocity_and_spin() {
        let ball = Flight {
            p: Vector3::zeros(),
            v: Vector3::new(-6.0, 0.0, 0.0),
            k: 0.0,
            lift: Vector3::new(0.0, -0.01, 0.0),
        };
        let lift = ball.acceleration() + Vector3::new(0.0, 0.0, GRAVITY);
        assert!((lift - Vector3::new(0.0, 0.0, -0.06)).norm() < 1e-12);
    }

    /// Thesis: drag shortens a throw of 5 m by more than 20 cm.
    #[test]
    fn air_costs_a_throw_of_five_metres_more_than_twenty_centimetres() {
        let angle = 0.5f64;
        let range = |k: f64| {
            let path = FlightPath::new(Flight::without_spin(
                Vector3::zeros(),
                Vector3::new(7.0 * angle.cos(), 0.0, 7.0 * angle.sin()),
                k,
            ));
            let landing = (1..2000)
                .map(|i| path.at(f64::from(i) * 1e-3))
                .find(|b| b.p.z < 0.0);
            landing.map(|b| b.p.x).unwrap_or(f64::NAN)
        };
        let lost = range(0.0) - range(DRAG);
        assert!(lost > 0.2, "{lost}");
    }
}
