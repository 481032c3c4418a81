//! The way from where the robot waits to where it is, for going back.

use tactnet_catching_packets::{JOINTS, Joint};

use crate::safety::{Bodies, Interval, PAIRS, distance};

/// Ticks that are kept, of motion only: 20 s.
const LONGEST: usize = 20_000;
/// Seconds of a tick.
pub(super) const TICK: f64 = 1e-3;
/// Share of the speed that it came with.
const BACK: f64 = 0.5;
/// By how much that changes in a tick: in a fifth of a second it is reached.
const CHANGE: f64 = BACK / 200.0;
/// The same while it brakes on the way: in a sixteenth of a second it stands.
const STOP: f64 = BACK / 62.0;
/// What was halved when it had to brake grows by so much in a tick: doubled after a second.
const REGAINED: f64 = 1.000_693_4;
/// Bodies keep this distance on a straight way, m.
const MARGIN: f64 = 0.02;
/// Joint angles of a straight way are looked at so densely, rad and m.
const DENSE: f64 = 0.02;

/// Joint positions, tick by tick, without those at which nothing moved.
#[derive(Debug, Clone)]
pub struct Trail {
    points: Vec<[f64; JOINTS]>,
    /// Where on it the robot is while it goes back, ticks from its begin.
    place: f64,
    rate: f64,
    /// Share of [`BACK`]: half after every time that it had to brake on the way, and growing again.
    share: f64,
    /// It has stopped at `place`, between two points, which stay.
    stopped: bool,
}

impl Trail {
    /// Begins where the robot waits.
    pub fn new(ready: &[f64; JOINTS]) -> Self {
        let mut points = Vec::with_capacity(LONGEST);
        points.push(*ready);
        Self {
            points,
            place: 0.0,
            rate: 0.0,
            share: 1.0,
            stopped: false,
        }
    }

    /// Takes where the robot is. Returns false if no more can be kept.
    pub fn push(&mut self, q: &[f64; JOINTS]) -> bool {
        let stands = self.stopped || self.points.last() == Some(q);
        if stands {
            return true;
        }
        if self.points.len() == LONGEST {
            return false;
        }
        self.points.push(*q);
        true
    }

    /// Begins to go back, or goes on with it.
    pub fn turn_round(&mut self) {
        if !self.stopped {
            self.place = (self.points.len() - 1) as f64;
        }
        self.stopped = false;
        self.rate = 0.0;
    }

    /// The next attempt is half as fast.
    pub fn slower(&mut self) {
        self.share *= 0.5;
    }

    /// Goes back by a tick; returns positions and velocities, and true once it is there.
    pub fn back(&mut self) -> ([f64; JOINTS], [f64; JOINTS], bool) {
        self.share = (self.share * REGAINED).min(1.0);
        let (fastest, change) = (BACK * self.share, CHANGE * self.share);
        // So that it stands at the begin.
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

    /// Slows down on the way; returns positions and velocities, and true once it stands.
    pub fn stop(&mut self) -> ([f64; JOINTS], [f64; JOINTS], bool) {
        self.rate = (self.rate - STOP).max(0.0).min(self.place);
        self.place -= self.rate;
        let (q, dq) = self.here();
        if self.rate > 0.0 {
            return (q, dq, false);
        }
        // Where it stands is no point of its own: a shorter step among others would be a jump of the velocity.
        self.stopped = true;
        (q, [0.0; JOINTS], true)
    }

    /// Positions and velocities where it is.
    fn here(&self) -> ([f64; JOINTS], [f64; JOINTS]) {
        let before = self.place.floor() as usize;
        let after = (before + 1).min(self.points.len() - 1);
        let part = self.place - before as f64;
        let (a, b) = (self.points[before], self.points[after]);
        let q = std::array::from_fn(|i| a[i] + (b[i] - a[i]) * part);
        let dq = std::array::from_fn(|i| -(b[i] - a[i]) * self.rate / TICK);
        (q, dq)
    }

    /// Replaces the trail by a straight way from where the robot waits to `q`, if bodies stay apart on it. Returns false otherwise.
    pub fn straight(
        &mut self,
        q: &[f64; JOINTS],
        joints: &[Joint; JOINTS],
        bodies: &Bodies,
    ) -> bool {
        let ready = self.points[0];
        let way: [f64; JOINTS] = std::array::from_fn(|i| q[i] - ready[i]);
        let at = |part: f64| -> [f64; JOINTS] { std::array::from_fn(|i| ready[i] + way[i] * part) };
        let longest = way.iter().fold(0.0, |most: f64, part| most.max(part.abs()));
        let looks = (longest / DENSE).ceil() as usize + 1;
        let free = (0..=looks).all(|look| is_free(&at(look as f64 / looks as f64), bodies));
        if !free {
            return false;
        }
        // A cosine in time: speed and acceleration at most those of the joint.
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
        let ticks = ((seconds / TICK).ceil() as usize).clamp(1, LONGEST - 1);
        self.points.truncate(1);
        self.points.extend((1..=ticks).map(|tick| {
            let part = tick as f64 / ticks as f64;
            at(0.5 - 0.5 * (std::f64::consts::PI * part).cos())
        }));
        true
    }
}

/// True if all pairs of bodies are apart by the margin.
fn is_free(q: &[f64; JOINTS], bodies: &Bodies) -> bool {
    let still = q.map(|q| Interval { low: q, high: q });
    (0..PAIRS).all(|pair| {
        let [a, b] = bodies.swept(pair, &still);
        distance(&a, &b) >= MARGIN
    })
}
