//! The table of pairs' distances, and the word that follows from it.

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

use super::bodies::{Bodies, PAIRS};
use super::gjk::distance;
use super::parts::least_in_parts;
use super::sweep::{Braking, Interval, braking};

/// Moments of a braking motion that are looked at.
const SAMPLES: usize = 48;
/// Joints that are slower stand, rad/s and m/s.
const STANDS: f64 = 1e-3;

/// How the monitor works.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorConfig {
    /// Least distance that is allowed, m.
    pub margin: f64,
    /// Least distance that is allowed to a robot that was braked and stands, m, until it is out of the margin again: what stands nearer than
    /// the margin, because its brakes were late, must be able to leave.
    pub leaving: f64,
    /// From a command to the moment at which drives brake, s.
    pub reaction: f64,
    /// Pairs that a tick computes anew, those with the least bounds.
    pub updates: usize,
    /// Pairs that a tick computes anew at most: beyond `updates` those whose bounds are too near, because of what they lost since they were
    /// computed.
    pub most_updates: usize,
    /// Parts of braking motions that a tick looks at, where pairs come too near in the hull of the whole motion.
    pub parts: usize,
}

impl Default for MonitorConfig {
    fn default() -> Self {
        Self {
            margin: 0.01,
            leaving: 0.005,
            reaction: 0.005,
            updates: 4,
            most_updates: 16,
            parts: 96,
        }
    }
}

/// What the monitor says of a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ruling {
    /// True if the robot may go on: braking at any later command that it allows keeps all bodies apart.
    pub go: bool,
    /// Least bound of a distance while the robot brakes, m.
    pub bound: f64,
    /// The pair that has it.
    pub pair: usize,
}

/// Watches commands, one after the other. Nothing allocates.
#[derive(Debug, Clone)]
pub struct Monitor {
    config: MonitorConfig,
    bodies: Bodies,
    joints: [Joint; JOINTS],
    known: [Known; PAIRS],
    /// Was the last command refused, and does the robot leave the margin?
    refused: bool,
    leaves: bool,
}

/// What a pair's distance was when it was computed, and for which motion.
#[derive(Debug, Clone, Copy)]
struct Known {
    distance: f64,
    intervals: [Interval; JOINTS],
}

impl Monitor {
    /// Begins with a robot at rest in `q`.
    pub fn new(
        bodies: Bodies,
        joints: [Joint; JOINTS],
        config: MonitorConfig,
        q: &[f64; JOINTS],
    ) -> Self {
        let still = q.map(|q| Interval { low: q, high: q });
        let mut known = [Known {
            distance: 0.0,
            intervals: still,
        }; PAIRS];
        for (pair, known) in known.iter_mut().enumerate() {
            let [a, b] = bodies.swept(pair, &still);
            known.distance = distance(&a, &b);
        }
        Self {
            config,
            bodies,
            joints,
            known,
            refused: false,
            leaves: false,
        }
    }

    /// Returns the settings.
    pub fn config(&self) -> &MonitorConfig {
        &self.config
    }

    /// Returns the bodies.
    pub fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    /// Returns where joints may be from a command until the robot has braked.
    pub fn intervals(&self, command: &JointCommand) -> [Interval; JOINTS] {
        std::array::from_fn(|i| {
            let (q, dq) = (command.q[i], command.dq[i]);
            braking(q, dq, &self.joints[i], self.config.reaction)
        })
    }

    /// Judges a command: could the robot brake from it without touching itself?
    pub fn judge(&mut self, command: &JointCommand) -> Ruling {
        if self.refused && command.dq.iter().all(|dq| dq.abs() < STANDS) {
            self.leaves = true;
        }
        let allowed = if self.leaves {
            self.config.leaving
        } else {
            self.config.margin
        };
        let intervals = self.intervals(command);
        let braking = Braking::new(command, &self.joints, self.config.reaction);
        let mut parts = self.config.parts;
        let mut bounds: [f64; PAIRS] = std::array::from_fn(|pair| self.bound(pair, &intervals));
        let mut fresh = [false; PAIRS];
        for update in 0..self.config.most_updates {
            let Some(pair) = least(&bounds, |pair| !fresh[pair]) else {
                break;
            };
            if update >= self.config.updates && bounds[pair] >= allowed {
                break;
            }
            let [a, b] = self.bodies.swept(pair, &intervals);
            let exact = distance(&a, &b);
            self.known[pair] = Known {
                distance: exact,
                intervals,
            };
            // What was known may be the tighter one: swept hulls are larger than the motion.
            bounds[pair] = bounds[pair].max(exact);
            if bounds[pair] < allowed {
                let finer = least_in_parts(&self.bodies, pair, &braking, allowed, &mut parts);
                bounds[pair] = bounds[pair].max(finer);
            }
            fresh[pair] = true;
        }
        let pair = least(&bounds, |_| true).unwrap_or(0);
        let go = bounds[pair] >= allowed;
        self.leaves &= bounds[pair] < self.config.margin;
        self.refused = !go;
        Ruling {
            go,
            bound: bounds[pair],
            pair,
        }
    }

    /// Returns the least distance of bodies from a command until the robot has braked, if its drives begin to brake at the end of the
    /// reaction, looked at 49 times, m: what a ruling bounds from below, by another way. Takes milliseconds.
    pub fn least_while_braking(&self, command: &JointCommand) -> f64 {
        let reaction = self.config.reaction;
        let braking = Braking::new(command, &self.joints, reaction);
        let longest = reaction + braking.longest();
        let mut least = f64::INFINITY;
        for sample in 0..=SAMPLES {
            let t = longest * sample as f64 / SAMPLES as f64;
            let q = braking.at(t.min(reaction), (t - reaction).max(0.0));
            for pair in 0..PAIRS {
                let [a, b] = self.bodies.placed(pair, &q);
                least = least.min(distance(&a, &b));
            }
        }
        least
    }

    /// A bound from below of a pair's distance while joints are in `intervals`: what it was, less what the bodies can have come nearer.
    fn bound(&self, pair: usize, intervals: &[Interval; JOINTS]) -> f64 {
        let known = &self.known[pair];
        let nearer: f64 = intervals
            .iter()
            .zip(&known.intervals)
            .enumerate()
            .map(|(joint, (now, then))| then.beyond(now) * self.bodies.reach(pair, joint))
            .sum();
        known.distance - nearer
    }
}

fn least(bounds: &[f64; PAIRS], wanted: impl Fn(usize) -> bool) -> Option<usize> {
    (0..PAIRS)
        .filter(|pair| wanted(*pair))
        .min_by(|a, b| bounds[*a].total_cmp(&bounds[*b]))
}
