//! Feasible points found by descents, and the choice among them.

use super::catch_motion::Point;
use super::seeds::MAX_SEEDS;
use super::sqp::Solution;

/// Maximum number of candidates: one from the previous plan, one per seed and one per descent.
const MAX_CANDIDATES: usize = 2 * MAX_SEEDS + 1;
/// Maximum distance between equal points, per component, in rad and s.
const SAME: f64 = 1e-3;

/// Feasible points, sorted by increasing cost.
pub(crate) struct Candidates {
    found: [Option<Solution>; MAX_CANDIDATES],
    count: usize,
}

impl Candidates {
    pub fn new() -> Self {
        Self {
            found: [None; MAX_CANDIDATES],
            count: 0,
        }
    }

    /// Adds a point. Points of equal cost keep their order.
    pub fn offer(&mut self, found: Option<Solution>) {
        let Some(found) = found else { return };
        if self.count == MAX_CANDIDATES {
            return;
        }
        let mut place = self.count;
        while place > 0 && self.found[place - 1].is_some_and(|other| found.cost < other.cost) {
            self.found[place] = self.found[place - 1];
            place -= 1;
        }
        self.found[place] = Some(found);
        self.count += 1;
    }

    /// Returns the cheapest point.
    pub fn cheapest(&self) -> Option<Solution> {
        self.found[0]
    }

    /// Returns the points that differ from all cheaper ones, sorted by increasing cost.
    pub fn distinct(&self) -> impl Iterator<Item = &Solution> {
        let found = &self.found[..self.count];
        found.iter().flatten().enumerate().filter_map(|(i, here)| {
            let mut cheaper = self.found[..i].iter().flatten();
            (!cheaper.any(|other| is_same(&other.x, &here.x))).then_some(here)
        })
    }
}

fn is_same(a: &Point, b: &Point) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < SAME)
}
