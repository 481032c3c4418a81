//! Release of a ball by a hand.
//!
//! Fingers start to open [`OPENING_NS`] before the release, so a later command releases late. The true time has a
//! random jitter. The ball leaves with the position and velocity of the true hand at that time, and rotates like the
//! hand; the fingers do not touch it any more.

use nalgebra::Vector3;
use rand_distr::{Distribution, Normal};
use serde::{Deserialize, Serialize};

use crate::ball::BallState;
use crate::error::{WorldError, not_negative};
use crate::robot::FrameMotion;
use crate::stream::Stream;

/// Time from the start of opening to the release, in ns.
pub(crate) const OPENING_NS: u64 = 10_000_000;
/// Maximum age of an opening command at which the fingers begin to open, in ns.
pub(crate) const TOLD_NS: u64 = 25_000_000;

tactnet_catching_packets::settings! {
    /// Settings of releases.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct ReleaseConfig in "release.": WorldError {
        /// Standard deviation of the release time, in s.
        pub jitter: f64 = 0.0005 => not_negative,
    }
}

/// A released ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Released {
    /// Arm, 0 for left and 1 for right.
    pub arm: usize,
    /// Time of the release, in ns.
    pub at_ns: u64,
    /// Position and velocity in the inertial frame.
    pub state: BallState,
    /// Angular velocity, in rad/s.
    pub spin: Vector3<f64>,
    /// Drag coefficient.
    pub drag: f64,
}

/// A ball in a hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Held {
    pub(crate) drag: f64,
    /// Time of the release, in ns.
    opens_ns: Option<u64>,
}

impl Held {
    pub(crate) fn new(drag: f64) -> Self {
        Self {
            drag,
            opens_ns: None,
        }
    }

    /// Takes a command at `now_ns`; only the first one counts.
    ///
    /// - `number`: number of the release, for its jitter
    pub(crate) fn open(
        &mut self,
        now_ns: u64,
        open_ns: u64,
        config: &ReleaseConfig,
        seed: u64,
        number: u64,
    ) {
        if self.opens_ns.is_some() {
            return;
        }
        let meant = open_ns.max(now_ns + OPENING_NS);
        let off = Normal::new(0.0, config.jitter * 1e9)
            .map(|normal| normal.sample(&mut Stream::Release.rng(seed, number)))
            .unwrap_or(0.0);
        self.opens_ns = Some((meant as f64 + off).max(now_ns as f64) as u64);
    }

    /// Returns the ball at its release if it happens in this tick.
    ///
    /// - `frames`: the hand at the start and the end of the tick
    pub(crate) fn leaves(
        &self,
        arm: usize,
        [start_ns, end_ns]: [u64; 2],
        frames: &[FrameMotion; 2],
    ) -> Option<Released> {
        let at_ns = self.opens_ns.filter(|opens| *opens < end_ns)?.max(start_ns);
        let tick = (end_ns - start_ns) as f64 * 1e-9;
        let part = (at_ns - start_ns) as f64 / (end_ns - start_ns) as f64;
        let [from, to] = frames;
        // Cubic Hermite interpolation of positions and velocities.
        let (s, r) = (part, 1.0 - part);
        let position = from.position * (r * r * (1.0 + 2.0 * s))
            + to.position * (s * s * (1.0 + 2.0 * r))
            + (from.velocity * r - to.velocity * s) * (r * s * tick);
        Some(Released {
            arm,
            at_ns,
            state: BallState {
                position,
                velocity: from.velocity * r + to.velocity * s,
            },
            spin: from.rate * r + to.rate * s,
            drag: self.drag,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    const MS: u64 = 1_000_000;

    /// Returns a hand on a parabola: 3 m/s up, with a deceleration of 20 m/s^2.
    fn frame(t: f64) -> FrameMotion {
        FrameMotion {
            position: Vector3::new(0.0, 1.0, 3.0 * t - 10.0 * t * t),
            rotation: Matrix3::identity(),
            velocity: Vector3::new(0.0, 0.0, 3.0 - 20.0 * t),
            rate: Vector3::new(0.0, 5.0, 0.0),
        }
    }

    fn exact() -> ReleaseConfig {
        ReleaseConfig { jitter: 0.0 }
    }

    #[test]
    fn a_ball_leaves_with_the_hands_motion_at_the_moment() {
        let mut held = Held::new(0.47);
        held.open(0, 20 * MS + 300_000, &exact(), 1, 0);
        let tick = |ms: u64| [ms * MS, (ms + 1) * MS];
        let frames = |ms: u64| [frame(ms as f64 * 1e-3), frame((ms + 1) as f64 * 1e-3)];
        assert_eq!(held.leaves(1, tick(19), &frames(19)), None);
        let released = held.leaves(1, tick(20), &frames(20)).unwrap();
        let there = frame(0.0203);
        assert_eq!((released.at_ns, released.arm), (20_300_000, 1));
        assert!((released.state.position - there.position).norm() < 1e-12);
        assert!((released.state.velocity - there.velocity).norm() < 1e-12);
        assert_eq!((released.spin, released.drag), (there.rate, 0.47));
    }

    #[test]
    fn a_late_command_lets_go_late_and_the_first_counts() {
        let mut held = Held::new(0.47);
        held.open(95 * MS, 100 * MS, &exact(), 1, 0);
        held.open(96 * MS, 200 * MS, &exact(), 1, 0);
        assert_eq!(held.opens_ns, Some(105 * MS));
    }

    #[test]
    fn the_moment_is_off_by_the_jitter() {
        let config = ReleaseConfig { jitter: 0.001 };
        let off: Vec<f64> = (0..1000)
            .map(|number| {
                let mut held = Held::new(0.47);
                held.open(0, 100 * MS, &config, 7, number);
                (held.opens_ns.unwrap() as f64 - 100e6) * 1e-6
            })
            .collect();
        let rms = (off.iter().map(|x| x * x).sum::<f64>() / 1000.0).sqrt();
        // The standard error of the estimate is 2 %.
        assert!((rms - 1.0).abs() < 0.1, "{rms}");
    }
}
