//! Slow collision-free way between two poses at rest.

use tactnet_catching_packets::JOINTS;

use crate::ramp::{LeastTime, Ramp};
use crate::robot::Robot;
use crate::safety::{Bodies, PAIRS, distance};

/// Time between collision checks, in s.
const CHECK_PERIOD: f64 = 0.01;
/// Maximum number of straight legs.
const LEGS: usize = 2;

/// Joint motion over time, in s from its start, with one or two straight legs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Way {
    legs: [[Ramp; JOINTS]; LEGS],
    ends: [f64; LEGS],
}

/// Request of a way.
#[derive(Debug, Clone, Copy)]
pub struct WayRequest<'a> {
    /// Start positions of all joints, at rest.
    pub from: &'a [f64; JOINTS],
    /// End positions of all joints, at rest.
    pub to: &'a [f64; JOINTS],
    /// Intermediate positions if the straight way is blocked.
    pub over: &'a [f64; JOINTS],
    /// Minimum distance of all bodies, in m, unless they are closer at the start.
    pub margin: f64,
    /// Fraction of the maximum speeds. Accelerations use its square.
    pub pace: f64,
}

impl Way {
    /// Returns the straight way, or the one over [`WayRequest::over`], whichever is first collision-free.
    ///
    /// # Errors
    /// Returns the pair of bodies that comes too close on the straight way if neither is.
    pub fn free(robot: &Robot, bodies: &Bodies, request: &WayRequest<'_>) -> Result<Self, usize> {
        let WayRequest {
            from,
            to,
            over,
            margin,
            pace,
        } = *request;
        let straight = Self::through(robot, [from, to, to], pace);
        let Some(pair) = touching(bodies, margin, straight.end(), |t| straight.at(t).0) else {
            return Ok(straight);
        };
        let round = Self::through(robot, [from, over, to], pace);
        match touching(bodies, margin, round.end(), |t| round.at(t).0) {
            None => Ok(round),
            Some(_) => Err(pair),
        }
    }

    fn through(robot: &Robot, stops: [&[f64; JOINTS]; LEGS + 1], pace: f64) -> Self {
        let gentle = robot.joints().map(|mut joint| {
            joint.speed *= pace;
            joint.acceleration *= pace * pace;
            joint
        });
        let mut ends = [0.0; LEGS];
        let legs = std::array::from_fn(|leg| {
            let (a, b) = (stops[leg], stops[leg + 1]);
            let least = (0..JOINTS).map(|i| LeastTime::exact(b[i] - a[i], 0.0, &gentle[i]).t);
            let end = least.fold(0.0, f64::max);
            ends[leg] = end;
            std::array::from_fn(|i| {
                if end > 0.0 {
                    Ramp::between(a[i], 0.0, b[i], end, gentle[i].speed)
                } else {
                    Ramp::standing(b[i])
                }
            })
        });
        Self { legs, ends }
    }

    /// Returns the ramps if the way is one straight leg.
    pub(super) fn straight(&self) -> Option<&[Ramp; JOINTS]> {
        let [_, round] = self.ends;
        (round == 0.0).then_some(&self.legs[0])
    }

    /// Returns the end of the motion, in s.
    pub fn end(&self) -> f64 {
        self.ends.iter().sum()
    }

    /// Returns positions and velocities of all joints at a time.
    pub fn at(&self, t: f64) -> ([f64; JOINTS], [f64; JOINTS]) {
        let (leg, since) = if t < self.ends[0] {
            (0, t)
        } else {
            (1, t - self.ends[0])
        };
        let all = self.legs[leg].map(|ramp| ramp.at(since));
        (all.map(|(q, _)| q), all.map(|(_, w)| w))
    }
}

/// Returns the first pair of bodies that comes closer than `margin` and closer than at the start.
pub(super) fn touching(
    bodies: &Bodies,
    margin: f64,
    end: f64,
    at: impl Fn(f64) -> [f64; JOINTS],
) -> Option<usize> {
    let apart = |pair: usize, q: &[f64; JOINTS]| {
        let [a, b] = bodies.placed(pair, q);
        distance(&a, &b)
    };
    let first = at(0.0);
    let least: [f64; PAIRS] = std::array::from_fn(|pair| apart(pair, &first).min(margin));
    (1..=(end / CHECK_PERIOD).ceil() as usize).find_map(|i| {
        let q = at(i as f64 * CHECK_PERIOD);
        (0..PAIRS).find(|pair| apart(*pair, &q) < least[*pair] - 1e-6)
    })
}
