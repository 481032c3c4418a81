//! State of a joint during its motion, with derivatives with respect to distance and duration.

use crate::ramp::Acceleration;

/// Joint at a fraction of its motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Passing {
    /// Position, in rad.
    pub q: f64,
    /// Velocity, in rad/s.
    pub rate: f64,
    /// Derivative of `q` with respect to the total distance.
    pub by_distance: f64,
    /// Derivative of `q` at the same fraction with respect to the duration, in rad/s.
    pub by_end: f64,
    /// Derivative of `rate` with respect to the distance, in 1/s.
    pub rate_by_distance: f64,
    /// Derivative of `rate` at the same fraction with respect to the duration, in rad/s^2.
    pub rate_by_end: f64,
}

impl Passing {
    /// Returns the joint after a fraction `share` of the motion [`Ramp::between`](crate::ramp::Ramp::between) from `q0`
    /// with velocity `w0` over a distance `d` in `end` > 0 seconds.
    pub fn new(q0: f64, w0: f64, d: f64, end: f64, speed: f64, share: f64) -> Self {
        let shape = Acceleration::new(d, end, w0, speed);
        let a = shape.a;
        let t = share * end;
        if a == 0.0 || !a.is_finite() {
            // At rest, use the limit of a vanishing motion: two parabolas, half of the distance each. The same values
            // apply out of reach.
            let (part, slope) = if share < 0.5 {
                (2.0 * share * share, 4.0 * share)
            } else {
                let left = 1.0 - share;
                (1.0 - 2.0 * left * left, 4.0 * left)
            };
            return Self {
                q: q0 + part * d,
                rate: 0.0,
                by_distance: part,
                by_end: 0.0,
                rate_by_distance: slope / end,
                rate_by_end: 0.0,
            };
        }
        // t1 and t2 with their derivatives with respect to `a` and the duration.
        let ([t1, t1_by_a, t1_by_end], [t2, t2_by_a, t2_by_end]) = if shape.trapezoid {
            let t1 = (shape.peak - w0) / a;
            let braking = shape.peak / a;
            ([t1, -t1 / a, 0.0], [end - braking, braking / a, 1.0])
        } else {
            let turn = [(end - w0 / a) / 2.0, w0 / (2.0 * a * a), 0.5];
            (turn, turn)
        };
        let (first, last) = ((t - t1).max(0.0), (t - t2).max(0.0));
        let by_a =
            (t * t - first * first - last * last) / 2.0 + a * (first * t1_by_a + last * t2_by_a);
        let rate = w0 + a * (t - first - last);
        let begun = |part: f64| if part > 0.0 { 1.0 } else { 0.0 };
        let (in_second, in_last) = (begun(first), begun(last));
        let rate_by_a = (t - first - last) + a * (in_second * t1_by_a + in_last * t2_by_a);
        Self {
            q: q0 + w0 * t + a / 2.0 * (t * t - first * first - last * last),
            rate,
            by_distance: by_a * shape.by_distance,
            by_end: rate * share
                + by_a * shape.by_time
                + a * (first * t1_by_end + last * t2_by_end),
            rate_by_distance: rate_by_a * shape.by_distance,
            rate_by_end: a
                * (share - in_second * (share - t1_by_end) - in_last * (share - t2_by_end))
                + rate_by_a * shape.by_time,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ramp::Ramp;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn it_passes_where_the_ramp_does_and_slopes_are_differences(
            speed in 0.5..3.0f64, w in -0.9..0.9f64, q0 in -2.0..2.0f64, way in -0.9..0.9f64, end in 0.1..1.5f64, share in 0.02..1.0f64,
        ) {
            // About the reachable distance at that speed.
            let (w0, d) = (w * speed, way * speed * end);
            let ramp = Ramp::between(q0, w0, q0 + d, end, speed);
            prop_assume!(ramp.a.is_finite() && ramp.a.abs() < 1e3);
            let at = |d: f64, end: f64| Passing::new(q0, w0, d, end, speed, share);
            let here = at(d, end);
            prop_assert!((here.q - ramp.at(share * end).0).abs() < 1e-9);
            let h = 1e-6;
            let by_distance = (at(d + h, end).q - at(d - h, end).q) / (2.0 * h);
            let by_end = (at(d, end + h).q - at(d, end - h).q) / (2.0 * h);
            // The second derivative jumps where triangles become trapezoids and where parts start.
            let scale = 1.0 + ramp.a.abs();
            prop_assert!((by_distance - here.by_distance).abs() < 1e-4 * scale, "{by_distance} {}", here.by_distance);
            prop_assert!((by_end - here.by_end).abs() < 1e-4 * scale, "{by_end} {}", here.by_end);
            // The velocity has kinks where parts start and where a triangle becomes a trapezoid.
            prop_assert!((here.rate - ramp.at(share * end).1).abs() < 1e-9 || share > 1.0 - 1e-9);
            let rates = |d: f64, end: f64| at(d, end).rate;
            let edge = |more: f64, less: f64| (more + less - 2.0 * here.rate).abs() > 1e-7 * scale;
            let (more, less) = (rates(d + h, end), rates(d - h, end));
            prop_assume!(!edge(more, less));
            prop_assert!(((more - less) / (2.0 * h) - here.rate_by_distance).abs() < 1e-3 * scale * (1.0 + here.rate_by_distance.abs()), "{} {}", (more - less) / (2.0 * h), here.rate_by_distance);
            let (more, less) = (rates(d, end + h), rates(d, end - h));
            prop_assume!(!edge(more, less));
            prop_assert!(((more - less) / (2.0 * h) - here.rate_by_end).abs() < 1e-3 * scale * (1.0 + here.rate_by_end.abs()), "{} {}", (more - less) / (2.0 * h), here.rate_by_end);
        }

        #[test]
        fn at_the_end_it_is_there(w in -1.0..1.0f64, d in -2.0..2.0f64, end in 0.1..1.5f64) {
            let there = Passing::new(0.3, w, d, end, 2.0, 1.0);
            prop_assume!(Acceleration::new(d, end, w, 2.0).a.is_finite());
            prop_assert!((there.q - 0.3 - d).abs() < 1e-9 && (there.by_distance - 1.0).abs() < 1e-6 && there.by_end.abs() < 1e-6);
        }
    }

    #[test]
    fn a_joint_that_stays_has_the_slopes_of_one_that_hardly_moves() {
        for share in [0.2, 0.5, 0.8, 1.0] {
            let stays = Passing::new(0.1, 0.0, 0.0, 0.6, 2.0, share);
            let moves = Passing::new(0.1, 0.0, 1e-7, 0.6, 2.0, share);
            let off = stays.by_distance - moves.by_distance;
            assert!(off.abs() < 1e-6, "{share}");
            assert!((stays.by_end - moves.by_end).abs() < 1e-6);
        }
    }
}
