//! A joint's motion in three parts, from any velocity to standstill (thesis, equation 3.1, as integrals): speed up with `a` until `t1`,
//! keep the velocity until `t2`, slow down with `a`.
//!
//! ```text
//! dq(t) = w0 + a (t - (t - t1)+ - (t - t2)+)      q(t) = q0 + w0 t + a/2 (t^2 - (t - t1)+^2 - (t - t2)+^2)      (x)+ = max(x, 0)
//! ```
//!
//! Where it ends and how long it takes determine everything else: [`Ramp::between`]. [`Acceleration`], [`Reach`] and [`LeastTime`] are
//! what a planner asks of it, with derivatives.

use tactnet_catching_packets::Joint;
use tactnet_catching_packets::packets::RampPacket;

/// Below this distance, rad or m, [`LeastTime`] is smooth instead of the square root that it is beyond.
pub const SMOOTH_DISTANCE: f64 = 1e-4;

/// One joint's motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    /// Position at the start, rad or m.
    pub q0: f64,
    /// Velocity at the start.
    pub w0: f64,
    /// Acceleration until `t1`, its negative from `t2`.
    pub a: f64,
    /// End of the first part, s.
    pub t1: f64,
    /// Begin of the last part, s.
    pub t2: f64,
    /// End, s; the joint stands from here.
    pub end: f64,
}

impl Ramp {
    /// Returns the motion from `q0` with velocity `w0` to a standstill at `q1` after `end` > 0 seconds, no faster than `speed`. Its
    /// acceleration is what that takes: compare with the joint's.
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

    /// Returns a joint that stands at `q`.
    pub fn standing(q: f64) -> Self {
        Self {
            q0: q,
            w0: 0.0,
            a: 0.0,
            t1: 0.0,
            t2: 0.0,
            end: 0.0,
        }
    }

    /// Returns the fastest motion to a standstill wherever that is, braking with `acceleration`.
    pub fn braking(q0: f64, w0: f64, acceleration: f64) -> Self {
        Self {
            q0,
            w0,
            a: acceleration.copysign(w0),
            t1: 0.0,
            t2: 0.0,
            end: w0.abs() / acceleration,
        }
    }

    /// Returns position and velocity at time `t` s from the start; before it as at the start, after the end as at the end.
    pub fn at(&self, t: f64) -> (f64, f64) {
        let t = t.clamp(0.0, self.end);
        let (first, last) = ((t - self.t1).max(0.0), (t - self.t2).max(0.0));
        let q = self.q0 + self.w0 * t + self.a / 2.0 * (t * t - first * first - last * last);
        let w = self.w0 + self.a * (t - first - last);
        if t >= self.end { (q, 0.0) } else { (q, w) }
    }

    /// Returns the least and the greatest position on the way.
    pub fn extent(&self) -> [f64; 2] {
        let (end, _) = self.at(self.end);
        let mut extent = [self.q0.min(end), self.q0.max(end)];
        // Where it turns round, in the first part.
        if self.w0 * self.a < 0.0 && -self.w0 / self.a < self.t1 {
            let turn = self.q0 - self.w0 * self.w0 / (2.0 * self.a);
            extent = [extent[0].min(turn), extent[1].max(turn)];
        }
        extent
    }

    /// Returns the greatest speed on the way.
    pub fn top_speed(&self) -> f64 {
        self.w0.abs().max((self.w0 + self.a * self.t1).abs())
    }

    /// Returns the motion that is left at time `t`, s: the same path, begun there.
    pub fn from(&self, t: f64) -> Self {
        let t = t.clamp(0.0, self.end);
        let (q0, w0) = self.at(t);
        Self {
            q0,
            w0,
            a: self.a,
            t1: (self.t1 - t).max(0.0),
            t2: (self.t2 - t).max(0.0),
            end: self.end - t,
        }
    }

    /// Returns what travelled.
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

    /// Returns it as it travels.
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

/// The acceleration that a motion needs, with its derivatives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Acceleration {
    /// In the first part.
    pub a: f64,
    /// Its derivative by the distance; 1/s^2.
    pub by_distance: f64,
    /// Its derivative by the time.
    pub by_time: f64,
    /// Velocity in the middle.
    pub peak: f64,
    /// True if the top speed is kept for a while.
    pub trapezoid: bool,
}

impl Acceleration {
    /// Returns what it takes to come to rest at a distance of `d` after `t` > 0 seconds, beginning with velocity `w0`, no faster than
    /// `speed`. Infinite where no acceleration would do: too far for the speed.
    pub fn new(d: f64, t: f64, w0: f64, speed: f64) -> Self {
        let x = 2.0 * d - t * w0;
        let s = if x < 0.0 { -1.0 } else { 1.0 };
        let root = x.hypot(t * w0);
        let a = (x + s * root) / (t * t);
        let peak = (w0 + a * t) / 2.0;
        if peak.abs() <= speed {
            // Half of the root is what is left between the peak, kept all the time, and the distance.
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
            return Self {
                a,
                by_distance: a / left,
                by_time: -a * peak / left,
                peak,
                trapezoid: false,
            };
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
        Self {
            a,
            by_distance: a / left,
            by_time: -a * peak / left,
            peak,
            trapezoid: true,
        }
    }
}

/// How far a joint can be from its start when it comes to rest after a given time; smooth in the time and, unlike the least time, linear
/// in the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reach {
    /// Least distance; negative unless the joint moves too fast to turn.
    pub low: f64,
    /// Greatest distance.
    pub high: f64,
    /// Derivative of `low` by the time.
    pub low_by_time: f64,
    /// Derivative of `high` by the time.
    pub high_by_time: f64,
}

impl Reach {
    /// Returns the reach after `t` seconds. Meaningful from `|w0| / acceleration` on: earlier the joint cannot stand.
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

/// The least time to a distance, with its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeastTime {
    /// s.
    pub t: f64,
    /// Derivative by the distance.
    pub by_distance: f64,
}

impl LeastTime {
    /// Returns the least time in which a joint comes to rest at a distance of `d`.
    pub fn exact(d: f64, w0: f64, joint: &Joint) -> Self {
        let (most, top) = (joint.acceleration, joint.speed);
        // Where it stands if it brakes at once.
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

    /// Returns the same without the edge where the joint only brakes: `d` is taken as `sqrt(x^2 + SMOOTH_DISTANCE^2)` away from there, so
    /// that the time is never too short.
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
            prop_assert!((ramp.from(at).at(t - at).0 - q0 - d).abs() < 1e-9);
        }

        #[test]
        fn derivatives_of_the_acceleration_are_differences(
            (speed, _, w0) in limits(), d in -3.0..3.0f64, t in 0.1..2.0f64,
        ) {
            let here = Acceleration::new(d, t, w0, speed);
            let h = 1e-6;
            let near = |d, t| Acceleration::new(d, t, w0, speed);
            let others = [near(d + h, t), near(d - h, t), near(d, t + h), near(d, t - h)];
            // At X = 0 the same motion has two names, a and -a.
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
