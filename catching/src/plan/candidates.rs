//! What descents found, and the choice among it.

use super::problem::Point;
use super::seeds::MAX_SEEDS;
use super::sqp::Found;

/// One from the last plan, each seed, and each seed's descent.
const MAX_CANDIDATES: usize = 2 * MAX_SEEDS + 1;
/// Points that are no farther apart, rad and s, are one.
const SAME: f64 = 1e-3;

/// Feasible points, the cheapest first.
pub(crate) struct Candidates {
    found: [Option<Found>; MAX_CANDIDATES],
    count: usize,
}

impl Candidates {
    pub fn new() -> Self {
        Self {
            found: [None; MAX_CANDIDATES],
            count: 0,
        }
    }

    /// Takes one in; of several that cost the same the first stays before the others.
    pub fn offer(&mut self, found: Option<Found>) {
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

    /// Returns the cheapest.
    pub fn cheapest(&self) -> Option<Found> {
        self.found[0]
    }

    /// Returns those that differ from all cheaper ones, the cheapest first.
    pub fn distinct(&self) -> impl Iterator<Item = &Found> {
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
