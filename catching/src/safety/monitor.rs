//! Table of pair distances and the decisions that follow from it.

use tactnet_catching_packets::packets::JointCommand;
use tactnet_catching_packets::{JOINTS, Joint};

use super::bodies::{Bodies, PAIRS};
use super::gjk::distance;
use super::parts::least_in_parts;
use super::sweep::{Braking, Interval, braking};

/// Number of samples of a braking motion.
const SAMPLES: usize = 48;
/// Maximum speed of a joint at rest, in rad/s and m/s.
const REST_SPEED: f64 = 1e-3;

tactnet_catching_packets::settings! {
    /// Settings of the monitor.
    #[derive(Debug, Clone, Copy, PartialEq)]
    pub struct MonitorConfig {
        /// Minimum distance, in m.
        pub margin: f64 = 0.01,
        /// Minimum distance for a robot that was braked and rests within the margin, in m. It applies until the robot
        /// has left the margin, so that a robot that braked too late can leave.
        pub leaving: f64 = 0.005,
        /// Delay from a brake command to the braking of the drives, in s.
        pub reaction: f64 = 0.005,
        /// Number of pairs recomputed in each tick, those with the smallest bounds.
        pub updates: usize = 4,
        /// Maximum number of pairs recomputed in each tick. Beyond `updates`, only pairs with bounds below the minimum
        /// distance are recomputed.
        pub most_updates: usize = 16,
        /// Maximum number of parts of braking motions per tick, for pairs too close in the hull of the whole motion.
        pub parts: usize = 96,
    }
}

/// Decision on a command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ruling {
    /// True if the robot may continue: it can still brake after this command with all bodies apart.
    pub go: bool,
    /// Smallest lower bound of a distance during braking, in m.
    pub bound: f64,
    /// Index of the pair with this bound.
    pub pair: usize,
}

/// Monitor of consecutive commands. Does not allocate.
#[derive(Debug, Clone)]
pub struct Monitor {
    config: MonitorConfig,
    bodies: Bodies,
    joints: [Joint; JOINTS],
    known: [Known; PAIRS],
    /// True if the last command was refused.
    refused: bool,
    leaves: bool,
}

/// Last computed distance of a pair, and the joint intervals that it applies to.
#[derive(Debug, Clone, Copy)]
struct Known {
    distance: f64,
    intervals: [Interval; JOINTS],
}

impl Monitor {
    /// Creates a monitor for a robot at rest in `q`.
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

    /// Returns the joint intervals from a command until the robot has braked.
    pub fn intervals(&self, command: &JointCommand) -> [Interval; JOINTS] {
        std::array::from_fn(|i| {
            let (q, dq) = (command.q[i], command.dq[i]);
            braking(q, dq, &self.joints[i], self.config.reaction)
        })
    }

    /// Decides whether the robot could brake after this command without touching itself.
    pub fn judge(&mut self, command: &JointCommand) -> Ruling {
        if self.refused && command.dq.iter().all(|dq| dq.abs() < REST_SPEED) {
            self.leaves = true;
        }
        let allowed = match self.leaves {
            true => self.config.leaving,
            false => self.config.margin,
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
            // The previous bound may be tighter, because swept hulls are larger than the motion.
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

    /// Returns the minimum distance from a command until the robot has braked, in m, for drives that brake at the end
    /// of the reaction time. It uses 49 samples and takes milliseconds; it serves to check the bounds of decisions.
    pub fn least_while_braking(&self, command: &JointCommand) -> f64 {
        let reaction = self.config.reaction;
        let braking = Braking::new(command, &self.joints, reaction);
        let longest = reaction + braking.longest();
        let mut least = f64::INFINITY;
        for sample in 0..=SAMPLES {
            let t = longest * sample as f64 / SAMPLES as f64;
            let q = braking.at(t.min(reaction), (t - reaction).max(0.0));
            least = least.min(self.bodies.least(&q));
        }
        least
    }

    /// Returns a lower bound of a pair's distance for joints within `intervals`: its last distance minus the maximum
    /// approach.
    fn bound(&self, pair: usize, intervals: &[Interval; JOINTS]) -> f64 {
        let known = &self.known[pair];
        let beyond = |joint: usize| known.intervals[joint].beyond(&intervals[joint]);
        let nearer = |joint: usize| beyond(joint) * self.bodies.reach(pair, joint);
        known.distance - (0..JOINTS).map(nearer).sum::<f64>()
    }
}

fn least(bounds: &[f64; PAIRS], wanted: impl Fn(usize) -> bool) -> Option<usize> {
    (0..PAIRS)
        .filter(|pair| wanted(*pair))
        .min_by(|a, b| bounds[*a].total_cmp(&bounds[*b]))
}
