//! Catch candidates on a grid of the remaining freedom: time, rotation of the hand about its axis, elbow angle.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARM_JOINTS;

use super::catch_motion::Point;
use super::problem::Problem;
use crate::robot::{HandPose, rotation_towards};

/// Number of closed-form branches: two each for elbow, shoulder and wrist.
const BRANCHES: usize = 8;
/// Maximum number of candidates.
pub(crate) const MAX_SEEDS: usize = 16;

/// Resolution of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Grid {
    /// Number of catch times while the ball is within reach.
    pub times: usize,
    /// Number of rotations of the hand about its axis.
    pub hands: usize,
    /// Number of elbow angles.
    pub elbows: usize,
}

/// Part of a search: every `of`-th catch time of the grid, from the time `index` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Share {
    /// Number of the part, from 0.
    pub index: usize,
    /// Number of parts.
    pub of: usize,
}

impl Default for Share {
    /// Returns the whole search.
    fn default() -> Self {
        Self { index: 0, of: 1 }
    }
}

/// Maximum sum of interval violations of a candidate, in rad. Descents may make it feasible.
const MAX_LACK: f64 = 1.5;

/// Candidate: hand at the ball and against its flight, joints within their intervals or close to them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seed {
    pub x: Point,
    /// Sum of the joints' interval violations, in rad.
    pub lack: f64,
    /// Value of the objective; infinite for an infeasible candidate.
    pub cost: f64,
}

impl Seed {
    fn is_better_than(&self, other: &Self) -> bool {
        if self.lack == 0.0 && other.lack == 0.0 {
            self.cost < other.cost
        } else {
            self.lack < other.lack
        }
    }
}

/// Best candidates, sorted by quality, with a minimum distance between them.
pub(crate) struct Seeds {
    seeds: [Seed; MAX_SEEDS],
    count: usize,
    /// Number of feasible candidates on the grid.
    pub feasible: usize,
    /// True if the ball comes within reach of the shoulder.
    pub within_reach: bool,
}

impl Seeds {
    /// Searches a part of a grid until `out_of_time`, which is called once per time and hand angle.
    pub fn search(
        problem: &Problem,
        grid: Grid,
        share: Share,
        mut out_of_time: impl FnMut() -> bool,
    ) -> Self {
        let mut seeds = Self {
            seeds: [Seed {
                x: [0.0; ARM_JOINTS + 1],
                lack: f64::INFINITY,
                cost: f64::INFINITY,
            }; MAX_SEEDS],
            count: 0,
            feasible: 0,
            within_reach: false,
        };
        let Some([first, last]) = while_within_reach(problem) else {
            return seeds;
        };
        seeds.within_reach = true;
        for i in (share.index..grid.times).step_by(share.of) {
            let t = first + (last - first) * (i as f64 + 0.5) / grid.times as f64;
            let ball = problem.path.at(t);
            let mut bodies = problem.own.simple.iter();
            if bodies.any(|body| body.distance(&ball.p).0 < 0.0) {
                continue;
            }
            let intervals: [[f64; 2]; ARM_JOINTS] = std::array::from_fn(|i| problem.interval(i, t));
            let axis = -ball.v / ball.v.norm();
            for hand in 0..grid.hands {
                if out_of_time() {
                    return seeds;
                }
                let pose = HandPose {
                    position: ball.p,
                    rotation: rotation_towards(&axis, hand as f64 * TAU / grid.hands as f64),
                };
                let Some(circle) = problem.motion.arm.elbow_circle(&pose) else {
                    // Independent of the hand angle.
                    break;
                };
                for elbow in 0..grid.elbows {
                    let angle = elbow as f64 * TAU / grid.elbows as f64;
                    circle.each(problem.motion.arm, angle, &mut |q| {
                        let lacks = q.iter().zip(&intervals);
                        let lacks = lacks.map(|(q, [low, high])| (low - q).max(q - high).max(0.0));
                        let lack = lacks.sum();
                        if lack < seeds.worth() {
                            seeds.offer(problem, &q, t, lack);
                        }
                    });
                }
            }
        }
        seeds
    }

    /// Returns the candidates, sorted by quality.
    pub fn best(&self) -> &[Seed] {
        &self.seeds[..self.count]
    }

    /// Returns the lack above which a candidate is not considered.
    fn worth(&self) -> f64 {
        if self.count == MAX_SEEDS {
            self.seeds[MAX_SEEDS - 1]
                .lack
                .clamp(f64::MIN_POSITIVE, MAX_LACK)
        } else {
            MAX_LACK
        }
    }

    fn offer(&mut self, problem: &Problem, q: &[f64; ARM_JOINTS], t: f64, lack: f64) {
        let x: Point = std::array::from_fn(|i| if i < ARM_JOINTS { q[i] } else { t });
        let mut seed = Seed {
            x,
            lack,
            cost: f64::INFINITY,
        };
        if lack == 0.0 {
            seed.cost = problem.request.objective.cost(&problem.motion, &x).0;
            // A joint that moves at the start may leave its range on the way.
            let moves = problem.motion.w0.iter().any(|w0| *w0 != 0.0);
            let leaves = moves && problem.motion.beyond_ranges(&x) > 0.0;
            if leaves || !seed.cost.is_finite() {
                return;
            }
            // One metre of missing distance counts as one radian outside of the interval.
            seed.lack = problem.too_near(q);
            if seed.lack > 0.0 {
                seed.cost = f64::INFINITY;
                if seed.lack >= self.worth() {
                    return;
                }
            } else {
                self.feasible += 1;
                if let Some(obstacles) = &problem.obstacles {
                    // Obstacles only increase the cost, so candidates that are too expensive without them can be
                    // skipped.
                    if self.place_for(&seed).is_none() {
                        return;
                    }
                    seed.cost += obstacles.cost(&problem.motion, &x).0;
                }
            }
        }
        let Some(mut place) = self.place_for(&seed) else {
            return;
        };
        self.count = self.count.max(place + 1);
        self.seeds[place] = seed;
        while place > 0 && self.seeds[place].is_better_than(&self.seeds[place - 1]) {
            self.seeds.swap(place, place - 1);
            place -= 1;
        }
    }

    /// Returns the index for a candidate: that of a worse one close to it, or of the worst. Returns `None` if the
    /// candidate is not good enough.
    fn place_for(&self, seed: &Seed) -> Option<usize> {
        let near = self.seeds[..self.count].iter().position(|other| {
            other.x[..ARM_JOINTS]
                .iter()
                .zip(&seed.x[..ARM_JOINTS])
                .all(|(a, b)| (a - b).abs() < 0.7)
        });
        match near {
            Some(place) if seed.is_better_than(&self.seeds[place]) => Some(place),
            Some(_) => None,
            None if self.count < MAX_SEEDS => Some(self.count),
            None if seed.is_better_than(&self.seeds[MAX_SEEDS - 1]) => Some(MAX_SEEDS - 1),
            None => None,
        }
    }
}

/// Returns the first and the last time at which the ball is within reach of the shoulder.
fn while_within_reach(problem: &Problem) -> Option<[f64; 2]> {
    let [least, most] = problem.times;
    let reach = problem.motion.arm.reach();
    let mut span: Option<[f64; 2]> = None;
    let steps = 120;
    for i in 0..=steps {
        let t = least + (most - least) * f64::from(i) / f64::from(steps);
        if (problem.path.at(t).p - problem.motion.arm.shoulder()).norm() < reach {
            span = Some(span.map_or([t, t], |[first, _]| [first, t]));
        }
    }
    span
}

/// All branches of one pose fit into the list.
const _: () = assert!(MAX_SEEDS >= BRANCHES);
