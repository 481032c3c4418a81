//! Judge: decides from the true state if a ball was caught.
//!
//! A ball is caught if its centre crosses the plane through the centre of the catch frame, perpendicular to the
//! hand's axis, at most [`MAX_ACROSS`] from the axis. The angle between the axis and the reversed velocity of the
//! ball must be at most [`MAX_ANGLE`], and the hand must close within [`MAX_ALONG_NS`] of the crossing.
//! Self-collisions are not checked.

use nalgebra::Vector3;
use tactnet_catching_packets::ARMS;

use crate::ball::BallState;
use crate::robot::FrameMotion;

/// Maximum distance from the hand's axis, in m.
pub const MAX_ACROSS: f64 = 0.02;
/// Maximum angle between the hand's axis and the reversed velocity of the ball, in rad: 25 degrees.
pub const MAX_ANGLE: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// Maximum time between closing and crossing, in ns.
pub const MAX_ALONG_NS: u64 = 5_000_000;
/// Distance from the axis beyond which a ball counts as not near, in m.
pub const NEAR: f64 = 0.15;

/// Crossing of a ball through the plane of a hand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crossing {
    /// Arm, 0 for left and 1 for right.
    pub arm: usize,
    /// Time, in ns.
    pub at_ns: u64,
    /// Distance from the hand's axis, in m.
    pub across_m: f64,
    /// Time from the crossing to the closing of the hand, in s; positive if too late, `None` without a closing
    /// command.
    pub along_s: Option<f64>,
    /// Angle between the hand's axis and the reversed velocity of the ball, in rad.
    pub angle: f64,
}

/// Cause of a miss. If several apply, the first in this order counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Miss {
    /// The ball did not cross a hand's plane within [`NEAR`].
    NeverCameNear = 1,
    /// No closing was commanded.
    NoCommand,
    /// The crossing was too far from the hand's axis.
    Across,
    /// The angle was too large.
    Angle,
    /// The hand closed too early.
    Early,
    /// The hand closed too late.
    Late,
}

/// Result of a throw of one ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Verdict {
    /// Number of the ball, counted over the lifetime of a world.
    pub ball: u64,
    /// Cause of the miss, or `None` if the ball was caught.
    pub miss: Option<Miss>,
    /// Crossing at which the ball was caught, or the one closest to a hand's axis; `None` without a crossing.
    pub crossing: Option<Crossing>,
}

impl Verdict {
    /// Returns true if the ball was caught.
    pub fn caught(&self) -> bool {
        self.miss.is_none()
    }
}

/// State of a hand during a tick.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HandDuring {
    /// Catch frames at the start and the end of the tick.
    pub(crate) frames: [FrameMotion; 2],
    /// Time at which the hand closes, in ns.
    pub(crate) closes_ns: Option<u64>,
}

/// Crossings of one ball so far.
#[derive(Debug, Clone, Default)]
pub(crate) struct Crossings {
    nearest: Option<Crossing>,
}

impl Crossings {
    /// Checks a tick. `flight` has the ball at evenly spaced times from `start_ns` to `end_ns`. Returns true once the
    /// ball is caught.
    pub(crate) fn observe(
        &mut self,
        [start_ns, end_ns]: [u64; 2],
        flight: &[BallState],
        hands: &[HandDuring; ARMS],
    ) -> bool {
        for (arm, hand) in hands.iter().enumerate() {
            let axis_and_middle = |part: f64| {
                let frame = FrameMotion::between(&hand.frames, part);
                (frame.rotation.column(2).normalize(), frame.position)
            };
            let intervals = (flight.len() - 1) as f64;
            let before_plane = |i: usize| {
                let (axis, middle) = axis_and_middle(i as f64 / intervals);
                axis.dot(&(flight[i].position - middle))
            };
            for i in 1..flight.len() {
                let (before, after) = (before_plane(i - 1), before_plane(i));
                if (before > 0.0) == (after > 0.0) {
                    continue;
                }
                // Linear interpolation over 0.1 ms has an error of g h^2 / 8, about a nanometre.
                let part = before / (before - after);
                let at = (i as f64 - 1.0 + part) / intervals;
                let (axis, middle) = axis_and_middle(at);
                let between = |a: Vector3<f64>, b: Vector3<f64>| a * (1.0 - part) + b * part;
                let off = between(flight[i - 1].position, flight[i].position) - middle;
                let velocity = between(flight[i - 1].velocity, flight[i].velocity);
                let at_ns = start_ns + ((end_ns - start_ns) as f64 * at).round() as u64;
                let crossing = Crossing {
                    arm,
                    at_ns,
                    across_m: (off - axis * axis.dot(&off)).norm(),
                    along_s: hand
                        .closes_ns
                        .map(|closes| (closes as f64 - at_ns as f64) * 1e-9),
                    angle: axis.angle(&-velocity),
                };
                let caught = miss(&crossing).is_none();
                if caught
                    || self
                        .nearest
                        .is_none_or(|nearest| crossing.across_m < nearest.across_m)
                {
                    self.nearest = Some(crossing);
                }
                if caught {
                    return true;
                }
            }
        }
        false
    }

    /// Returns the verdict on the ball with the given number.
    pub(crate) fn verdict(&self, ball: u64) -> Verdict {
        Verdict {
            ball,
            miss: self
                .nearest
                .map_or(Some(Miss::NeverCameNear), |crossing| miss(&crossing)),
            crossing: self.nearest,
        }
    }
}

fn miss(crossing: &Crossing) -> Option<Miss> {
    let limit = MAX_ALONG_NS as f64 * 1e-9;
    // Timestamps are whole nanoseconds.
    let rounding = 1e-9;
    match crossing.along_s {
        _ if crossing.across_m > NEAR => Some(Miss::NeverCameNear),
        None => Some(Miss::NoCommand),
        _ if crossing.across_m > MAX_ACROSS => Some(Miss::Across),
        _ if crossing.angle > MAX_ANGLE => Some(Miss::Angle),
        Some(along) if along < -limit - rounding => Some(Miss::Early),
        Some(along) if along > limit + rounding => Some(Miss::Late),
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Rotation3};
    use proptest::prelude::*;

    const MS: u64 = 1_000_000;
    /// Time at which the ball crosses the plane, in ns.
    const CROSSING_NS: u64 = 100_600_000;

    /// Returns a hand at the origin whose axis points along `axis`.
    fn hand(axis: Vector3<f64>, closes_ns: Option<u64>) -> HandDuring {
        let rotation = Rotation3::rotation_between(&Vector3::z(), &axis)
            .expect("not opposite")
            .into_inner();
        HandDuring {
            frames: [FrameMotion::still(Vector3::zeros(), rotation); 2],
            closes_ns,
        }
    }

    fn far() -> HandDuring {
        let mut hand = hand(Vector3::x(), None);
        for frame in &mut hand.frames {
            frame.position = Vector3::new(-50.0, 0.0, 0.0);
        }
        hand
    }

    /// Returns a flight along -x at 6 m/s that is at (0, y, z) at [`CROSSING_NS`] and starts 10.6 ms earlier, with
    /// its start and end time.
    fn flight(y: f64, z: f64) -> ([u64; 2], Vec<BallState>) {
        let velocity = Vector3::new(-6.0, 0.0, 0.0);
        let flight = (0..=200)
            .map(|i| BallState {
                position: Vector3::new(0.0, y, z) + velocity * (f64::from(i) * 1e-4 - 0.0106),
                velocity,
            })
            .collect();
        ([90 * MS, 110 * MS], flight)
    }

    fn judged(y: f64, z: f64, axis: Vector3<f64>, closes_ns: Option<u64>) -> Verdict {
        let (times, flight) = flight(y, z);
        let mut crossings = Crossings::default();
        let caught = crossings.observe(times, &flight, &[hand(axis, closes_ns), far()]);
        let verdict = crossings.verdict(3);
        assert_eq!(caught, verdict.caught());
        verdict
    }

    #[test]
    fn a_ball_through_the_middle_at_the_right_time_is_caught() {
        let verdict = judged(0.0, 0.0, Vector3::x(), Some(CROSSING_NS));
        assert!(verdict.caught());
        let crossing = verdict.crossing.unwrap();
        assert_eq!((crossing.arm, crossing.at_ns), (0, CROSSING_NS));
        assert!(crossing.across_m < 1e-12 && crossing.angle < 1e-7);
    }

    #[test]
    fn each_rule_has_its_own_cause() {
        let x = Vector3::x();
        let at = |shift: i64| Some(CROSSING_NS.saturating_add_signed(shift));
        let turned = |degrees: f64| Rotation3::new(Vector3::z() * degrees.to_radians()) * x;
        let ms = MS as i64;
        for (verdict, miss) in [
            (judged(0.019, 0.0, x, at(0)), None),
            (judged(0.012, 0.012, x, at(0)), None),
            (judged(0.021, 0.0, x, at(0)), Some(Miss::Across)),
            (judged(0.0, 0.04, x, at(0)), Some(Miss::Across)),
            (judged(0.0, 0.16, x, at(0)), Some(Miss::NeverCameNear)),
            (judged(0.0, 0.0, x, None), Some(Miss::NoCommand)),
            (judged(0.0, 0.0, x, at(5 * ms)), None),
            (judged(0.0, 0.0, x, at(-5 * ms)), None),
            (judged(0.0, 0.0, x, at(6 * ms)), Some(Miss::Late)),
            (judged(0.0, 0.0, x, at(-6 * ms)), Some(Miss::Early)),
            (judged(0.0, 0.0, x, at(30 * ms)), Some(Miss::Late)),
            (judged(0.0, 0.0, turned(24.9), at(0)), None),
            (judged(0.0, 0.0, turned(-25.1), at(0)), Some(Miss::Angle)),
        ] {
            assert_eq!(verdict.miss, miss, "{verdict:?}");
        }
        let late = judged(0.0, 0.0, x, at(30 * ms)).crossing.unwrap();
        assert!((late.along_s.unwrap() - 0.03).abs() < 1e-9);
    }

    #[test]
    fn a_ball_from_behind_is_not_caught() {
        let behind = Rotation3::new(Vector3::z() * 3.0) * Vector3::x();
        let verdict = judged(0.0, 0.0, behind, Some(CROSSING_NS));
        assert_eq!(verdict.miss, Some(Miss::Angle));
    }

    #[test]
    fn a_ball_that_crosses_nothing_never_came_near() {
        let verdict = Crossings::default().verdict(0);
        assert_eq!(verdict.miss, Some(Miss::NeverCameNear));
        assert_eq!(verdict.crossing, None);
    }

    proptest! {
        /// The verdict does not depend on a common rotation of hand and ball, nor on the order of the arms.
        #[test]
        fn the_judge_does_not_care_about_directions_or_arms(
            turn in proptest::array::uniform3(-2.0..2.0f64),
            y in -0.03..0.03f64, z in -0.03..0.03f64, shift in -8i64..8, lean in -0.6..0.6f64,
        ) {
            let closes = Some(CROSSING_NS.saturating_add_signed(shift * 999_000));
            let axis = Rotation3::new(Vector3::z() * lean) * Vector3::x();
            let plain = judged(y, z, axis, closes);
            let turn: Matrix3<f64> = Rotation3::new(Vector3::from(turn)).into_inner();
            let (times, mut flight) = flight(y, z);
            for ball in &mut flight {
                ball.position = turn * ball.position;
                ball.velocity = turn * ball.velocity;
            }
            let mut turned = hand(axis, closes);
            for frame in &mut turned.frames {
                frame.rotation = turn * frame.rotation;
            }
            let mut crossings = Crossings::default();
            crossings.observe(times, &flight, &[far(), turned]);
            let other = crossings.verdict(3);
            prop_assert_eq!(plain.miss, other.miss);
            let (plain, other) = (plain.crossing.unwrap(), other.crossing.unwrap());
            prop_assert!((plain.across_m - other.across_m).abs() < 1e-12);
            prop_assert!((plain.at_ns as i64 - other.at_ns as i64).abs() <= 1);
            prop_assert_eq!(other.arm, 1);
        }
    }
}
