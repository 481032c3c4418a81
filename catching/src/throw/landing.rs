//! Landing position of a thrown ball, with derivatives with respect to its release.
//!
//! The ball flies without spin. The derivatives with respect to the release velocity are integrated together with its
//! state by the same Runge-Kutta steps: `dV/dt = A V`, `dP/dt = V` with `A = -k (|v| I + v v' / |v|)`. The derivatives
//! at a given height follow from those at a fixed time: `dp = (I - v e_z' / v_z) dp(t)`.

use nalgebra::{Matrix3, Vector3};

use crate::flight::{GRAVITY, STEP};

/// Maximum number of integration steps, which is 4 s of flight.
const STEPS: usize = 400;

/// State of a ball when it falls through a height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Landing {
    /// Time since the release, in s.
    pub t: f64,
    /// Position, in m.
    pub p: Vector3<f64>,
    /// Velocity, in m/s.
    pub v: Vector3<f64>,
    /// Derivative of `p` with respect to the release position.
    pub by_p: Matrix3<f64>,
    /// Derivative of `p` with respect to the release velocity, in s.
    pub by_v: Matrix3<f64>,
}

#[derive(Debug, Clone, Copy)]
struct State {
    p: Vector3<f64>,
    v: Vector3<f64>,
    p_by_v: Matrix3<f64>,
    v_by_v: Matrix3<f64>,
}

impl Landing {
    /// Returns the state of a ball, released at `p` with `v`, when it falls through `height`. Returns `None` if it does
    /// not rise so high or does not land within 4 s.
    ///
    /// - `k`: drag coefficient, in 1/m
    pub fn of(p: &Vector3<f64>, v: &Vector3<f64>, k: f64, height: f64) -> Option<Self> {
        let mut state = State {
            p: *p,
            v: *v,
            p_by_v: Matrix3::zeros(),
            v_by_v: Matrix3::identity(),
        };
        for i in 0..STEPS {
            let next = state.step(k, STEP);
            let through = next.v.z < 0.0 && next.p.z <= height && state.p.z > height;
            // The ball rises through the height and falls again within one step, or starts to fall at the height.
            let turned = state.v.z > 0.0 && next.p.z <= height && next.v.z < 0.0;
            if through || turned {
                return state.land(k, height, i as f64 * STEP);
            }
            if next.v.z < 0.0 && next.p.z <= height {
                return None;
            }
            state = next;
        }
        None
    }
}

impl State {
    /// Performs one fourth-order Runge-Kutta step of the state and its derivatives.
    fn step(&self, k: f64, h: f64) -> Self {
        let slope = |v: &Vector3<f64>, by: &Matrix3<f64>| {
            let speed = v.norm();
            let a = Vector3::new(0.0, 0.0, -GRAVITY) - v * (k * speed);
            let turned = v * (v.transpose() * by) / speed.max(f64::MIN_POSITIVE);
            (a, (by * speed + turned) * -k)
        };
        let (a1, b1) = slope(&self.v, &self.v_by_v);
        let (v2, w2) = (self.v + a1 * (h / 2.0), self.v_by_v + b1 * (h / 2.0));
        let (a2, b2) = slope(&v2, &w2);
        let (v3, w3) = (self.v + a2 * (h / 2.0), self.v_by_v + b2 * (h / 2.0));
        let (a3, b3) = slope(&v3, &w3);
        let (v4, w4) = (self.v + a3 * h, self.v_by_v + b3 * h);
        let (a4, b4) = slope(&v4, &w4);
        Self {
            p: self.p + (self.v + (v2 + v3) * 2.0 + v4) * (h / 6.0),
            v: self.v + (a1 + (a2 + a3) * 2.0 + a4) * (h / 6.0),
            p_by_v: self.p_by_v + (self.v_by_v + (w2 + w3) * 2.0 + w4) * (h / 6.0),
            v_by_v: self.v_by_v + (b1 + (b2 + b3) * 2.0 + b4) * (h / 6.0),
        }
    }

    /// Computes the landing within the current step.
    fn land(&self, k: f64, height: f64, since: f64) -> Option<Landing> {
        // Start beyond the apex.
        let mut h = STEP;
        for _ in 0..8 {
            let there = self.step(k, h);
            if there.v.z >= 0.0 {
                return None;
            }
            h -= (there.p.z - height) / there.v.z;
        }
        let there = self.step(k, h);
        // A flight whose apex is just below the height does not land.
        if there.v.z >= -1e-6 || (there.p.z - height).abs() > 1e-9 {
            return None;
        }
        let mut by_p = Matrix3::identity();
        by_p.set_column(2, &(Vector3::z() - there.v / there.v.z));
        Some(Landing {
            t: since + h,
            p: there.p,
            v: there.v,
            by_v: by_p * there.p_by_v,
            by_p,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::{DRAG, Flight};
    use proptest::prelude::*;

    fn release() -> impl Strategy<Value = (Vector3<f64>, Vector3<f64>)> {
        (
            proptest::array::uniform3(-1.0..1.0f64),
            proptest::array::uniform3(-6.0..6.0f64),
        )
            .prop_map(|(p, v)| (p.into(), Vector3::new(v[0], v[1], v[2].abs() + 1.0)))
    }

    proptest! {
        #[test]
        fn a_landing_is_on_the_flight((p, v) in release(), drop in 0.1..1.5f64) {
            let landing = Landing::of(&p, &v, DRAG, p.z - drop).unwrap();
            let flight = Flight::without_spin(p, v, DRAG).after(landing.t);
            // The integration steps end elsewhere, with different errors of fifth order.
            prop_assert!((flight.p - landing.p).norm() < 1e-7);
            prop_assert!((landing.p.z - (p.z - drop)).abs() < 1e-9 && landing.v.z < 0.0);
        }

        #[test]
        fn derivatives_are_differences((p, v) in release(), drop in 0.1..1.5f64) {
            let height = p.z - drop;
            let landing = Landing::of(&p, &v, DRAG, height).unwrap();
            let h = 1e-5;
            for i in 0..3 {
                let mut by = Vector3::zeros();
                by[i] = h;
                let at = |p: Vector3<f64>, v: Vector3<f64>| Landing::of(&p, &v, DRAG, height).unwrap().p;
                let by_v = (at(p, v + by) - at(p, v - by)) / (2.0 * h);
                prop_assert!((by_v - landing.by_v.column(i)).norm() < 1e-5, "{by_v} {}", landing.by_v.column(i));
                let by_p = (at(p + by, v) - at(p - by, v)) / (2.0 * h);
                prop_assert!((by_p - landing.by_p.column(i)).norm() < 1e-5);
            }
        }
    }

    #[test]
    fn a_ball_that_does_not_rise_so_high_does_not_come_down_there() {
        let p = Vector3::new(0.0, 0.0, 1.0);
        for (rise, height) in [(1.0, 2.0), (-1.0, 1.5)] {
            let v = Vector3::new(3.0, 0.0, rise);
            assert_eq!(Landing::of(&p, &v, DRAG, height), None);
        }
    }
}
