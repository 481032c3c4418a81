//! Trail from the waiting pose to the current pose, for returning.

use tactnet_catching_packets::{JOINTS, Joint};

use crate::safety::Bodies;

/// Maximum number of ticks in the trail: 20 s of motion.
const MAX_POINTS: usize = 20_000;
/// Duration of a tick, in s.
pub(super) const TICK: f64 = 1e-3;
/// Speed on the way back, relative to the original speed.
const RETURN_SPEED: f64 = 0.5;
/// Change of the relative speed per tick; full speed is reached after 0.2 s.
const ACCELERATION: f64 = RETURN_SPEED / 200.0;
/// Change of the relative speed per tick while braking; the robot rests after 1/16 s.
const DECELERATION: f64 = RETURN_SPEED / 62.0;
/// Growth per tick of a speed that was halved by braking; it doubles in one second.
const SPEED_REGAIN: f64 = 1.000_693_4;
/// Minimum distance between bodies on a straight way, in m.
const MARGIN: f64 = 0.02;
/// Maximum step between collision checks on a straight way, in rad and m.
const CHECK_STEP: f64 = 0.02;

/// Sequence of joint positions, one per tick, without ticks at rest.
#[derive(Debug, Clone)]
pub(super) struct Trail {
    points: Vec<[f64; JOINTS]>,
    /// Current position on the trail during the return, in ticks from its start.
    place: f64,
    rate: f64,
    /// Factor on [`RETURN_SPEED`]: halved by each braking on the way back, then growing again.
    share: f64,
    /// True if the robot rests at `place`, between two points that are kept.
    stopped: bool,
}

impl Trail {
    /// Creates a trail that starts in the waiting pose.
    pub(super) fn new(ready: &[f64; JOINTS]) -> Self {
        let mut points = Vec::with_capacity(MAX_POINTS);
        points.push(*ready);
        Self {
            points,
            place: 0.0,
            rate: 0.0,
            share: 1.0,
            stopped: false,
        }
    }

    /// Appends the current position. Returns false if the trail is full.
    pub(super) fn push(&mut self, q: &[f64; JOINTS]) -> bool {
        let stands = self.stopped || self.points.last() == Some(q);
        if stands {
            return true;
        }
        if self.points.len() == MAX_POINTS {
            return false;
        }
        self.points.push(*q);
        true
    }

    /// Starts or resumes the return.
    pub(super) fn turn_round(&mut self) {
        if !self.stopped {
            self.place = (self.points.len() - 1) as f64;
        }
        self.stopped = false;
        self.rate = 0.0;
    }

    /// Halves the speed of the next attempt.
    pub(super) fn slower(&mut self) {
        self.share *= 0.5;
    }

    /// Moves back by one tick. Returns positions, velocities, and true on arrival.
    pub(super) fn back(&mut self) -> ([f64; JOINTS], [f64; JOINTS], bool) {
        self.share = (self.share * SPEED_REGAIN).min(1.0);
        let (fastest, change) = (RETURN_SPEED * self.share, ACCELERATION * self.share);
        // Decelerate such that the motion ends at the start of the trail.
        let left = (2.0 * change * self.place).sqrt();
        self.rate = (self.rate + change).min(fastest).min(left);
        self.place = (self.place - self.rate).max(0.0);
        let there = self.place < 1e-3;
        if there {
            self.points.truncate(1);
            self.share = 1.0;
            return (self.points[0], [0.0; JOINTS], true);
        }
        let (q, dq) = self.here();
        self.points.truncate(self.place.floor() as usize + 2);
        (q, dq, false)
    }

    /// Brakes on the trail. Returns positions, velocities, and true at rest.
    pub(super) fn stop(&mut self) -> ([f64; JOINTS], [f64; JOINTS], bool) {
        self.rate = (self.rate - DECELERATION).max(0.0).min(self.place);
        self.place -= self.rate;
        let (q, dq) = self.here();
        if self.rate > 0.0 {
            return (q, dq, false);
        }
        // The stopping position is not added as a point: one shorter step would cause a velocity jump.
        self.stopped = true;
        (q, [0.0; JOINTS], true)
    }

    /// Returns positions and velocities at the current position.
    fn here(&self) -> ([f64; JOINTS], [f64; JOINTS]) {
        let before = self.place.floor() as usize;
        let after = (before + 1).min(self.points.len() - 1);
        let part = self.place - before as f64;
        let (a, b) = (self.points[before], self.points[after]);
        let q = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * part);
        let dq = std::array::from_fn(|i| -(b[i] - a[i]) * self.rate / TICK);
        (q, dq)
    }

    /// Replaces the trail by a straight way from the waiting pose to `q` if it is collision-free. Returns false
    /// otherwise.
    pub(super) fn straight(
        &mut self,
        q: &[f64; JOINTS],
        joints: &[Joint; JOINTS],
        bodies: &Bodies,
    ) -> bool {
        let ready = self.points[0];
        let way: [f64; JOINTS] = std::array::from_fn(|i| q[i] - ready[i]);
        let at = |part: f64| -> [f64; JOINTS] { std::array::from_fn(|i| ready[i] + way[i] * part) };
        let longest = way.iter().fold(0.0, |most: f64, part| most.max(part.abs()));
        let looks = (longest / CHECK_STEP).ceil() as usize + 1;
        let apart = |look: usize| bodies.least(&at(look as f64 / looks as f64));
        let free = (0..=looks).all(|look| apart(look) >= MARGIN);
        if !free {
            return false;
        }
        // Cosine profile whose speed and acceleration keep the joint limits.
        let seconds = way
            .iter()
            .zip(joints)
            .fold(TICK, |most: f64, (part, joint)| {
                let part = part.abs();
                let by_speed = std::f64::consts::FRAC_PI_2 * part / joint.speed;
                let by_acceleration =
                    std::f64::consts::PI * (0.5 * part / joint.acceleration).sqrt();
                most.max(by_speed).max(by_acceleration)
            });
        let ticks = ((seconds / TICK).ceil() as usize).clamp(1, MAX_POINTS - 1);
        self.points.truncate(1);
        self.points.extend((1..=ticks).map(|tick| {
            let part = tick as f64 / ticks as f64;
            at(0.5 - 0.5 * (std::f64::consts::PI * part).cos())
        }));
        true
    }
}
