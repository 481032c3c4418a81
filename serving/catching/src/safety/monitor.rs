//! The table of pairs' distances, and the word that follows from it.

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

use super::bodies::{Bodies, PAIRS};
use super::gjk::distance;
use super::sweep::{Interval, braking, braking_between, braking_time};

/// Moments of a braking motion that are looked at.
const SAMPLES: usize = 48;

/// How the monitor works.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorConfig {
    /// Least distance that is allowed, m.
    pub margin: f64,
    /// From a command to the moment at which drives brake, s.
    pub reaction: f64,
    /// Pairs that a tick computes anew, those with the least bounds.
    pub updates: usize,
    /// Times that a part of the braking time is halved, in which a pair comes too near, before it ends a motion.
    pub halvings: usize,
}

impl Default for MonitorConfig {
    fn default() -> Self {
        Self {
            margin: 0.01,
            reaction: 0.005,
            updates: 4,
            halvings: 5,
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
        let intervals = self.intervals(command);
        let mut bounds: [f64; PAIRS] = std::array::from_fn(|pair| self.bound(pair, &intervals));
        let mut fresh = [false; PAIRS];
        for _ in 0..self.config.updates {
            let Some(pair) = least(&bounds, |pair| !fresh[pair]) else {
                break;
            };
            let [a, b] = self.bodies.swept(pair, &intervals);
            let exact = distance(&a, &b);
            self.known[pair] = Known {
                distance: exact,
                intervals,
            };
            // What was known may be the tighter one: swept hulls are larger than the motion.
            bounds[pair] = bounds[pair].max(exact);
            if bounds[pair] < self.config.margin {
                let whole = [0.0, self.longest(command)];
                let parts = self.in_parts(pair, command, whole, self.config.halvings, bounds[pair]);
                bounds[pair] = bounds[pair].max(parts);
            }
            fresh[pair] = true;
        }
        let pair = least(&bounds, |_| true).unwrap_or(0);
        Ruling {
            go: bounds[pair] >= self.config.margin,
            bound: bounds[pair],
            pair,
        }
    }

    /// Returns the least distance of bodies from a command until the robot has braked, looked at 49 times, m: what a ruling bounds from
    /// below, by another way. Takes milliseconds.
    pub fn least_while_braking(&self, command: &JointCommand) -> f64 {
        let longest = self.longest(command);
        let mut least = f64::INFINITY;
        for sample in 0..=SAMPLES {
            let t = longest * sample as f64 / SAMPLES as f64;
            let q = self.braked(command, t);
            for pair in 0..PAIRS {
                let [a, b] = self.bodies.placed(pair, &q);
                least = least.min(distance(&a, &b));
            }
        }
        least
    }

    /// Where joints are, so long after a command from which they brake.
    fn braked(&self, command: &JointCommand, t: f64) -> [f64; JOINTS] {
        let reaction = self.config.reaction;
        std::array::from_fn(|i| {
            let (q, dq) = (command.q[i], command.dq[i]);
            let acceleration = self.joints[i].acceleration;
            let slowing = (t - reaction).clamp(0.0, dq.abs() / acceleration);
            q + dq * (t.min(reaction) + slowing)
                - 0.5 * dq.signum() * acceleration * slowing * slowing
        })
    }

    /// How long the robot takes from a command until it stands still, s.
    fn longest(&self, command: &JointCommand) -> f64 {
        let reaction = self.config.reaction;
        (0..JOINTS)
            .map(|i| braking_time(command.dq[i], &self.joints[i], reaction))
            .fold(0.0, f64::max)
    }

    /// A bound from below of a pair's distance over a part of the braking time, in seconds after the command. At any moment joints are in the
    /// intervals of one part together, which are far smaller than those of the whole motion: a part whose bound is below the margin is
    /// halved, up to `depth` times. No better than `enough` is looked for.
    fn in_parts(
        &self,
        pair: usize,
        command: &JointCommand,
        [from, to]: [f64; 2],
        depth: usize,
        enough: f64,
    ) -> f64 {
        let middle = 0.5 * (from + to);
        let mut least = f64::INFINITY;
        for part in [[from, middle], [middle, to]] {
            let intervals = std::array::from_fn(|i| {
                let (q, dq) = (command.q[i], command.dq[i]);
                braking_between(q, dq, &self.joints[i], self.config.reaction, part)
            });
            let [a, b] = self.bodies.swept(pair, &intervals);
            let mut bound = distance(&a, &b);
            if bound < self.config.margin && depth > 1 {
                bound = bound.max(self.in_parts(pair, command, part, depth - 1, enough));
            }
            least = least.min(bound);
            if least <= enough {
                break;
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
