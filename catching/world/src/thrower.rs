//! Thrower: origin, speed and target of balls.

use nalgebra::{Matrix2, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::GRAVITY;
use crate::ball::{Aerodynamics, BallState};
use crate::error::{WorldError, rising};

/// Maximum duration of a flight in the aiming computation, in s.
const LONGEST: f64 = 3.0;
/// Integration step of the aiming computation, in s; its error over a throw is below a nanometre.
const STEP: f64 = 2e-3;
/// Maximum distance of the ball's centre from its target, in m.
const NEAR: f64 = 1e-7;

/// Expected values of a range above 0.
const ABOVE_0: &str = "[least, greatest], greater than 0";

tactnet_catching_packets::settings! {
    /// Ranges of origins and targets of throws, in the inertial frame.
    ///
    /// With this box, two nominal arms with the hands half a metre ahead can catch most throws: 76 % of 200 if they
    /// start 0.15 s after the release, 61 % for 0.25 s.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ThrowerConfig in "thrower.": WorldError {
        /// Minimum and maximum distance in front of the robot along x, in m.
        pub distance: [f64; 2] = [4.0, 6.0] => rising(f64::MIN_POSITIVE, ABOVE_0),
        /// Minimum and maximum lateral position along y, in m.
        pub aside: [f64; 2] = [-0.5, 0.5] => rising(f64::MIN, "[least, greatest]"),
        /// Minimum and maximum height of the release, in m.
        pub height: [f64; 2] = [1.2, 1.8] => rising(f64::MIN_POSITIVE, ABOVE_0),
        /// Minimum and maximum speed at the release, in m/s. A throw that falls short is drawn again, so slow throws
        /// come from near.
        pub speed: [f64; 2] = [6.0, 8.0] => rising(f64::MIN_POSITIVE, ABOVE_0),
        /// Corner of the target box with minimum x, y and z, in m.
        pub box_least: [f64; 3] = [0.3, -0.85, 0.95],
        /// Opposite corner, in m; targets are uniform in the box.
        pub box_greatest: [f64; 3] = [0.7, 0.85, 1.45],
        /// Minimum and maximum time between two balls of a throw, in s.
        pub gap: [f64; 2] = [0.0, 0.3] => rising(0.0, "[least, greatest] from 0"),
    }
}

impl ThrowerConfig {
    /// Checks the ranges, and that throws reach the box in this air.
    pub(crate) fn check(&self, air: &Aerodynamics) -> Result<(), WorldError> {
        self.check_settings()?;
        let setting = "thrower.box_least to box_greatest";
        let expected = "corners of which the second is nowhere the lesser";
        for side in self.box_least.into_iter().zip(self.box_greatest) {
            rising(f64::MIN, expected)(setting, &side.into())?;
        }
        let from = Vector3::new(
            self.distance[0],
            (self.aside[0] + self.aside[1]) / 2.0,
            (self.height[0] + self.height[1]) / 2.0,
        );
        for number in 0..8 {
            let corner = std::array::from_fn(|i| match number >> i & 1 {
                0 => self.box_least[i],
                _ => self.box_greatest[i],
            });
            if aim(air, &from, self.speed[1], &corner.into()).is_none() {
                return Err(WorldError::OutOfThrow {
                    corner,
                    speed: self.speed[1],
                    distance: self.distance[0],
                });
            }
        }
        Ok(())
    }

    /// Draws the time since the previous throw in s, and the ball at its release.
    pub(crate) fn draw(&self, air: &Aerodynamics, rng: &mut ChaCha8Rng) -> (f64, BallState) {
        let mut between = |[low, high]: [f64; 2]| low + (high - low) * rng.random::<f64>();
        let gap = between(self.gap);
        loop {
            let target =
                Vector3::from_fn(|i, _| between([self.box_least[i], self.box_greatest[i]]));
            // After 1000 failures, the target is out of reach from nearly all origins.
            for _ in 0..1000 {
                let from = Vector3::new(
                    between(self.distance),
                    between(self.aside),
                    between(self.height),
                );
                let speed = between(self.speed);
                if let Some(velocity) = aim(air, &from, speed, &target) {
                    let ball = BallState {
                        position: from,
                        velocity,
                    };
                    return (gap, ball);
                }
            }
        }
    }
}

/// Returns the velocity with which a ball from `from` passes through `target` on the flatter of two trajectories, or
/// `None` if it falls short.
fn aim(
    air: &Aerodynamics,
    from: &Vector3<f64>,
    speed: f64,
    target: &Vector3<f64>,
) -> Option<Vector3<f64>> {
    let way = target - from;
    let distance = way.xy().norm();
    // Flat solution in vacuum, or the farthest throw if there is none.
    let square = speed * speed;
    let root = square * square - GRAVITY * (GRAVITY * distance * distance + 2.0 * way.z * square);
    let mut angles = Vector2::new(
        (square - root.max(0.0).sqrt()).atan2(GRAVITY * distance),
        way.y.atan2(way.x),
    );
    let velocity = |angles: &Vector2<f64>| {
        let ((sin, cos), (side, ahead)) = (angles.x.sin_cos(), angles.y.sin_cos());
        Vector3::new(cos * ahead, cos * side, sin) * speed
    };
    let miss = |angles: &Vector2<f64>| pass(air, from, &velocity(angles), target);
    for _ in 0..20 {
        let missed = miss(&angles)?;
        let d = 1e-5;
        let higher = miss(&(angles + Vector2::new(d, 0.0)))?;
        let aside = miss(&(angles + Vector2::new(0.0, d)))?;
        let slope = Matrix2::from_columns(&[(higher - missed) / d, (aside - missed) / d]);
        // Beyond the farthest throw, a higher one is shorter.
        if slope[(0, 0)] <= 0.0 {
            return None;
        }
        if missed.norm() < NEAR {
            return Some(velocity(&angles));
        }
        let mut change = slope.try_inverse()? * missed;
        // Near the farthest throw the slope is small and the Newton step too long.
        change.x = change.x.clamp(-0.1, 0.1);
        angles -= change;
    }
    None
}

/// Returns the distance by which a ball passes above and left of `target` in m, in the vertical plane through it
/// across the throw, or `None` if the ball does not get there.
fn pass(
    air: &Aerodynamics,
    from: &Vector3<f64>,
    velocity: &Vector3<f64>,
    target: &Vector3<f64>,
) -> Option<Vector2<f64>> {
    let ahead = Vector3::new(target.x - from.x, target.y - from.y, 0.0).normalize();
    let left = Vector3::z().cross(&ahead);
    let mut ball = BallState {
        position: *from,
        velocity: *velocity,
    };
    for _ in 0..(LONGEST / STEP) as usize {
        let next = air.fly(&ball, STEP);
        if (next.position - target).dot(&ahead) < 0.0 {
            ball = next;
            continue;
        }
        // Newton steps from the last point before the plane onto it.
        let mut h = 0.0;
        for _ in 0..4 {
            let there = air.fly(&ball, h);
            h -= (there.position - target).dot(&ahead) / there.velocity.dot(&ahead);
        }
        let off = air.fly(&ball, h).position - target;
        return Some(Vector2::new(off.z, off.dot(&left)));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ball::BallConfig;
    use crate::stream::Stream;

    #[test]
    fn throws_come_from_where_they_should_and_pass_through_the_box() {
        let (thrower, config) = (ThrowerConfig::default(), BallConfig::default());
        let mut flights = Vec::new();
        for number in 0..200 {
            let air = Aerodynamics::draw(&config, &mut Stream::Ball.rng(3, number));
            let (gap, thrown) = thrower.draw(&air, &mut Stream::Thrower.rng(3, number));
            assert!((0.0..=0.3).contains(&gap));
            assert!((4.0..=6.0).contains(&thrown.position.x));
            assert!((6.0..=8.0 + 1e-12).contains(&thrown.velocity.norm()));
            // The flatter trajectory.
            assert!(thrown.velocity.z < thrown.velocity.xy().norm());
            let mut ball = thrown;
            let mut inside = false;
            let mut time = 0.0;
            while ball.position.z > 0.0 && ball.position.x > 0.0 {
                ball = air.fly(&ball, 1e-3);
                time += 1e-3;
                // Distance covered in two steps.
                let margin = 0.02;
                inside |= (0..3).all(|i| {
                    (thrower.box_least[i] - margin..=thrower.box_greatest[i] + margin)
                        .contains(&ball.position[i])
                });
            }
            assert!(inside, "{thrown:?}");
            flights.push(time);
        }
        flights.sort_by(f64::total_cmp);
        // "about 1 s" (thesis, 3.1).
        assert!((0.6..1.1).contains(&flights[100]), "{}", flights[100]);
    }

    #[test]
    fn a_throw_that_is_too_slow_is_none() {
        let air = Aerodynamics::new(&BallConfig::default(), 0.47, Vector3::zeros());
        let from = Vector3::new(5.0, 0.0, 1.5);
        let target = Vector3::new(0.5, 0.3, 1.2);
        assert_eq!(aim(&air, &from, 5.0, &target), None);
        assert!(aim(&air, &from, 7.5, &target).is_some());
    }

    #[test]
    fn a_box_out_of_reach_is_an_error() {
        let air = Aerodynamics::new(&BallConfig::default(), 0.47, Vector3::zeros());
        let thrower = ThrowerConfig {
            speed: [3.0, 4.0],
            ..ThrowerConfig::default()
        };
        let error = thrower.check(&air).unwrap_err();
        assert!(matches!(error, WorldError::OutOfThrow { .. }), "{error}");
    }
}
