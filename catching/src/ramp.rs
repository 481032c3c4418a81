//! Three-part motion of a joint from any velocity to rest (thesis, equation 3.1, integrated): acceleration `a` until
//! `t1`, constant velocity until `t2`, deceleration `a`.
//!
//! ```text
//! dq(t) = w0 + a (t - (t - t1)+ - (t - t2)+)      q(t) = q0 + w0 t + a/2 (t^2 - (t - t1)+^2 - (t - t2)+^2)      (x)+ = max(x, 0)
//! ```
//!
//! End position and duration determine the motion: [`Ramp::between`]. [`Acceleration`], [`Reach`] and [`LeastTime`]
//! give planners its limits, with derivatives.

use tactnet_catching_packets::Joint;
use tactnet_catching_packets::packets::RampPacket;

/// Distance, in rad or m, below which [`LeastTime::smooth`] replaces the square root by a smooth function.
pub const SMOOTH_DISTANCE: f64 = 1e-4;

/// Motion of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Ramp {
    /// Position at the start, in rad or m.
    pub q0: f64,
    /// Velocity at the start, in rad/s or m/s.
    pub w0: f64,
    /// Acceleration until `t1`, in rad/s^2 or m/s^2; its negative applies from `t2`.
    pub a: f64,
    /// End of the acceleration, in s.
    pub t1: f64,
    /// Start of the deceleration, in s.
    pub t2: f64,
    /// End of the motion, in s. The joint is at rest afterwards.
    pub end: f64,
}

impl Ramp {
    /// Returns the motion from `q0` with velocity `w0` to rest at `q1` after `end` > 0 seconds with at most `speed`.
    /// The required acceleration may exceed the joint's limit; the caller must compare.
    pub fn between(q0: f64, w0: f64, q1: f64, end: f64, speed: f64) -> Self {
        let shape = Acceleration::new(q1 - q0, end, w0, speed);
        let a = shape.a;
        let (t1, t2) = if a == 0.0 {
            (end, end)
        } else if shape.trapezoid {
            ((shape.peak - w0) / a, end - shape.peak / a)
        } else {
            let t = (end - w0 / a) / 2.0;
            (t, t)
        };
        Self {
            q0,
            w0,
            a,
            t1: t1.clamp(0.0, end),
            t2: t2.clamp(0.0, end),
            end,
        }
    }

    /// Returns a joint at rest at `q`.
    pub fn standing(q: f64) -> Self {
        Self {
            q0: q,
            ..Self::default()
        }
    }

    /// Returns the fastest motion to rest with the given acceleration.
    pub fn braking(q0: f64, w0: f64, acceleration: f64) -> Self {
        Self {
            q0,
            w0,
            a: acceleration.copysign(w0),
            end: w0.abs() / acceleration,
            ..Self::default()
        }
    }

    /// Returns position and velocity at time `t`, in s from the start. Times outside of the motion give its start or
    /// end.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let t = t.clamp(0.0, self.end);
        let (first, last) = ((t - self.t1).max(0.0), (t - self.t2).max(0.0));
        let q = self.q0 + self.w0 * t + self.a / 2.0 * (t * t - first * first - last * last);
        let w = self.w0 + self.a * (t - first - last);
        if t >= self.end { (q, 0.0) } else { (q, w) }
    }

    /// Returns the lowest and the highest position of the motion.
    pub fn extent(&self) -> [f64; 2] {
        let (end, _) = self.at(self.end);
        let mut extent = [self.q0.min(end), self.q0.max(end)];
        // The joint reverses in the first part.
        if self.w0 * self.a < 0.0 && -self.w0 / self.a < self.t1 {
            let turn = self.q0 - self.w0 * self.w0 / (2.0 * self.a);
            extent = [extent[0].min(turn), extent[1].max(turn)];
        }
        extent
    }

    /// Returns true if all values are finite.
    pub(crate) fn is_finite(&self) -> bool {
        [self.q0, self.w0, self.a, self.t1, self.t2, self.end]
            .iter()
            .all(|number| number.is_finite())
    }

    /// Returns the maximum speed of the motion.
    pub fn top_speed(&self) -> f64 {
        self.w0.abs().max((self.w0 + self.a * self.t1).abs())
    }

    /// Converts from a packet.
    pub fn of(packet: &RampPacket) -> Self {
        Self {
            q0: packet.q0,
            w0: packet.w0,
            a: packet.a,
            t1: packet.t1,
            t2: packet.t2,
            end: packet.end,
        }
    }

    /// Converts to a packet.
    pub fn packet(&self) -> RampPacket {
        RampPacket {
            q0: self.q0,
            w0: self.w0,
            a: self.a,
            t1: self.t1,
            t2: self.t2,
            end: self.end,
        }
    }
}

/// Acceleration that a motion requires, with its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acceleration {
    /// Acceleration in the first part.
    pub a: f64,
    /// Derivative with respect to the distance, in 1/s^2.
    pub by_distance: f64,
    /// Derivative with respect to the duration.
    pub by_time: f64,
    /// Velocity in the middle part.
    pub peak: f64,
    /// True if the motion keeps the maximum speed for some time.
    pub trapezoid: bool,
}

impl Acceleration {
    /// Returns the acceleration for coming to rest at a distance of `d` after `t` > 0 seconds, with initial velocity
    /// `w0` and at most `speed`. Infinite if the distance is out of reach at that speed.
    pub fn new(d: f64, t: f64, w0: f64, speed: f64) -> Self {
        let x = 2.0 * d - t * w0;
        let s = if x < 0.0 { -1.0 } else { 1.0 };
        let root = x.hypot(t * w0);
        let a = (x + s * root) / (t * t);
        let peak = (w0 + a * t) / 2.0;
        if peak.abs() <= speed {
            // Half the root is the difference between `peak t` and the distance.
            let left = s * root / 2.0;
            if left == 0.0 {
                return Self {
                    a: 0.0,
                    by_distance: 4.0 / (t * t),
                    by_time: 0.0,
                    peak: 0.0,
                    trapezoid: false,
                };
            }
            return Self::of(a, left, peak, false);
        }
        let peak = s * speed;
        let left = peak * t - d;
        if left * s <= 0.0 {
            return Self {
                a: s * f64::INFINITY,
                by_distance: 0.0,
                by_time: 0.0,
                peak,
                trapezoid: true,
            };
        }
        let a = (peak * peak + (peak - w0) * (peak - w0)) / (2.0 * left);
        Self::of(a, left, peak, true)
    }

    /// Returns an acceleration with its derivatives.
    ///
    /// - `left`: difference between the distance at speed `peak` and the required one, in rad or m
    fn of(a: f64, left: f64, peak: f64, trapezoid: bool) -> Self {
        Self {
            a,
            by_distance: a / left,
            by_time: -a * peak / left,
            peak,
            trapezoid,
        }
    }
}

/// Range of distances at which a joint can come to rest after a given time. The range is smooth in time and, unlike the
/// least time, linear in the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Lowest distance; positive only if the joint is too fast to reverse.
    pub low: f64,
    /// Highest distance.
    pub high: f64,
    /// Derivative of `low` with respect to time.
    pub low_by_time: f64,
    /// Derivative of `high` with respect to time.
    pub high_by_time: f64,
}

impl Reach {
    /// Returns the range after `t` seconds. Valid for `t >= |w0| / acceleration`; the joint cannot come to rest
    /// earlier.
    pub fn new(t: f64, w0: f64, joint: &Joint) -> Self {
        let (high, high_by_time) = farthest(t, w0, joint);
        let (low, low_by_time) = farthest(t, -w0, joint);
        Self {
            low: -low,
            high,
            low_by_time: -low_by_time,
            high_by_time,
        }
    }
}

fn farthest(t: f64, w0: f64, joint: &Joint) -> (f64, f64) {
    let (a, top) = (joint.acceleration, joint.speed);
    let peak = (w0 + a * t) / 2.0;
    if peak <= top {
        ((2.0 * peak * peak - w0 * w0) / (2.0 * a), peak)
    } else {
        (
            top * t - (top * top + (top - w0) * (top - w0)) / (2.0 * a),
            top,
        )
    }
}

/// Least time to a distance, with its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastTime {
    /// Least time, in s.
    pub t: f64,
    /// Derivative with respect to the distance.
    pub by_distance: f64,
}

impl LeastTime {
    /// Returns the least time in which a joint comes to rest at a distance of `d`.
    pub fn exact(d: f64, w0: f64, joint: &Joint) -> Self {
        let (most, top) = (joint.acceleration, joint.speed);
        // Distance at which the joint comes to rest if it brakes at once.
        let braked = w0 * w0.abs() / (2.0 * most);
        let s = if d < braked { -1.0 } else { 1.0 };
        let a = s * most;
        let peak = s * (a * d + w0 * w0 / 2.0).max(0.0).sqrt();
        if peak.abs() <= top {
            let by_distance = if peak == 0.0 { 0.0 } else { 1.0 / peak };
            Self {
                t: (2.0 * peak - w0) / a,
                by_distance,
            }
        } else {
            let peak = s * top;
            Self {
                t: d / peak + (peak * peak + (peak - w0) * (peak - w0)) / (2.0 * a * peak),
                by_distance: 1.0 / peak,
            }
        }
    }

    /// Returns a smooth upper bound of the least time, without the kink at the pure braking motion. The distance `x`
    /// from that kink is replaced by `sqrt(x^2 + SMOOTH_DISTANCE^2)`.
    pub fn smooth(d: f64, w0: f64, joint: &Joint) -> Self {
        let braked = w0 * w0.abs() / (2.0 * joint.acceleration);
        let x = d - braked;
        let away = x.hypot(SMOOTH_DISTANCE);
        let s = if x < 0.0 { -1.0 } else { 1.0 };
        let at = Self::exact(braked + s * away, w0, joint);
        Self {
            t: at.t,
            by_distance: at.by_distance * s * x / away,
        }
    }
}

/// Returns ramps from rest to rest that start and end together, as soon as the limits permit, and their duration in s.
pub fn together<const N: usize>(
    from: &[f64; N],
    to: &[f64; N],
    limits: &[Joint; N],
) -> ([Ramp; N], f64) {
    let least = |i: usize| LeastTime::exact(to[i] - from[i], 0.0, &limits[i]).t;
    let end = (0..N).map(least).fold(0.0, f64::max);
    let ramp = |i: usize| match end > 0.0 {
        true => Ramp::between(from[i], 0.0, to[i], end, limits[i].speed),
        false => Ramp::standing(to[i]),
    };
    (std::array::from_fn(ramp), end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn joint(speed: f64, acceleration: f64) -> Joint {
        Joint {
            range: [-3.0, 3.0],
            speed,
            acceleration,
        }
    }

    fn limits() -> impl Strategy<Value = (f64, f64, f64)> {
        (0.3..6.0f64, 2.0..60.0f64, -1.0..1.0f64)
            .prop_map(|(speed, a, share)| (speed, a, share * speed))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn a_ramp_ends_where_and_when_it_should_and_keeps_the_speed(
            (speed, _, w0) in limits(), q0 in -3.0..3.0f64, d in -3.0..3.0f64, t in 0.05..2.0f64,
        ) {
            let ramp = Ramp::between(q0, w0, q0 + d, t, speed);
            prop_assume!(ramp.a.is_finite() && ramp.a.abs() < 1e4);
            let (q, w) = ramp.at(t);
            prop_assert!((q - q0 - d).abs() < 1e-9, "{q} {}", q0 + d);
            prop_assert_eq!(w, 0.0);
            let before = ramp.at(t * (1.0 - 1e-9)).1;
            prop_assert!(before.abs() < 1e-4, "{before}");
            prop_assert!(ramp.top_speed() <= speed + 1e-9);
            prop_assert!(0.0 <= ramp.t1 && ramp.t1 <= ramp.t2 + 1e-12 && ramp.t2 <= t);
        }

        #[test]
        fn velocity_is_the_derivative_and_nothing_lies_outside_the_extent(
            (speed, _, w0) in limits(), q0 in -3.0..3.0f64, d in -3.0..3.0f64, t in 0.05..2.0f64, share in 0.01..0.99f64,
        ) {
            let ramp = Ramp::between(q0, w0, q0 + d, t, speed);
            prop_assume!(ramp.a.is_finite() && ramp.a.abs() < 1e3);
            let (at, h) = (share * t, 1e-6);
            let slope = (ramp.at(at + h).0 - ramp.at(at - h).0) / (2.0 * h);
            prop_assert!((slope - ramp.at(at).1).abs() < 1e-3 + ramp.a.abs() * h);
            let [low, high] = ramp.extent();
            let q = ramp.at(at).0;
            prop_assert!(low - 1e-9 <= q && q <= high + 1e-9);
        }

        #[test]
        fn derivatives_of_the_acceleration_are_differences(
            (speed, _, w0) in limits(), d in -3.0..3.0f64, t in 0.1..2.0f64,
        ) {
            let here = Acceleration::new(d, t, w0, speed);
            let h = 1e-6;
            let near = |d, t| Acceleration::new(d, t, w0, speed);
            let others = [near(d + h, t), near(d - h, t), near(d, t + h), near(d, t - h)];
            // At X = 0 the motion has two representations, a and -a.
            prop_assume!(others.iter().all(|o| o.a.is_finite() && o.trapezoid == here.trapezoid && o.a.signum() == here.a.signum()));
            prop_assume!((2.0 * d - t * w0).hypot(t * w0) > 1e-3 && here.a.abs() < 1e3);
            let scale = 1.0 + here.a.abs() / t;
            prop_assert!(((others[0].a - others[1].a) / (2.0 * h) - here.by_distance).abs() < 1e-4 * (scale + here.by_distance.abs()));
            prop_assert!(((others[2].a - others[3].a) / (2.0 * h) - here.by_time).abs() < 1e-4 * (scale + here.by_time.abs()));
        }

        #[test]
        fn the_least_time_is_the_one_that_takes_all_of_the_acceleration(
            (speed, a, w0) in limits(), d in -3.0..3.0f64,
        ) {
            let joint = joint(speed, a);
            let least = LeastTime::exact(d, w0, &joint);
            prop_assume!(least.t > 1e-3);
            prop_assert!((Acceleration::new(d, least.t, w0, speed).a.abs() - a).abs() < 1e-6 * a);
            prop_assert!(Acceleration::new(d, least.t * 1.01, w0, speed).a.abs() <= a * (1.0 + 1e-9));
        }

        #[test]
        fn within_reach_is_what_the_least_time_allows(
            (speed, a, w0) in limits(), d in -3.0..3.0f64, t in 0.0..2.0f64,
        ) {
            let joint = joint(speed, a);
            prop_assume!(t >= w0.abs() / a);
            let reach = Reach::new(t, w0, &joint);
            prop_assume!((d - reach.low).abs() > 1e-9 && (d - reach.high).abs() > 1e-9);
            prop_assert_eq!(reach.low <= d && d <= reach.high, LeastTime::exact(d, w0, &joint).t <= t);
            let h = 1e-7;
            let (more, less) = (Reach::new(t + h, w0, &joint), Reach::new(t - h, w0, &joint));
            prop_assert!(((more.high - less.high) / (2.0 * h) - reach.high_by_time).abs() < 1e-4);
            prop_assert!(((more.low - less.low) / (2.0 * h) - reach.low_by_time).abs() < 1e-4);
        }

        #[test]
        fn the_smooth_least_time_is_never_shorter_and_has_a_derivative_everywhere(
            (speed, a, w0) in limits(), d in -3.0..3.0f64,
        ) {
            let joint = joint(speed, a);
            let smooth = LeastTime::smooth(d, w0, &joint);
            let exact = LeastTime::exact(d, w0, &joint);
            prop_assert!(smooth.t >= exact.t - 1e-12);
            prop_assert!(smooth.t - exact.t < 2.0 * (SMOOTH_DISTANCE / a).sqrt() + 1e-6 + SMOOTH_DISTANCE / speed);
            let h = 1e-7;
            let slope = (LeastTime::smooth(d + h, w0, &joint).t - LeastTime::smooth(d - h, w0, &joint).t) / (2.0 * h);
            prop_assert!((slope - smooth.by_distance).abs() < 1e-3 * (1.0 + slope.abs()), "{slope} {}", smooth.by_distance);
        }

        #[test]
        fn braking_ends_in_a_standstill((_, a, w0) in limits(), q0 in -3.0..3.0f64) {
            let ramp = Ramp::braking(q0, w0, a);
            let (q, w) = ramp.at(10.0);
            prop_assert!((q - q0 - w0 * w0.abs() / (2.0 * a)).abs() < 1e-12 && w == 0.0);
        }
    }
}
