//! Assignment of one picture's circles: the best children of all hypotheses.

use tactnet_catching_packets::packets::MAX_CIRCLES;

use super::{Candidate, Child, Hypotheses, Hypothesis, MAX_TRACKS, NONE};
use crate::track::murty::Costs;

/// Columns of a hypothesis' cost matrix: its tracks, left circles, and clutter for each row.
struct Columns {
    /// Index of the first left circle.
    lefts: usize,
    /// Index of the first clutter column.
    clutter: usize,
}

/// Circles of a picture that may be more than clutter. Each has a row of the cost matrix.
struct CircleRows {
    circles: [usize; MAX_CIRCLES],
    count: usize,
}

impl CircleRows {
    fn circles(&self) -> &[usize] {
        &self.circles[..self.count]
    }
}

/// Weights of one picture's circles.
struct Scan<'a> {
    candidates: &'a [Candidate],
    gains: &'a [f64],
    log_clutter: f64,
}

impl Hypotheses {
    /// Computes the best children of all hypotheses.
    ///
    /// - `count`: number of circles in the picture
    pub(super) fn assign(&mut self, count: usize) {
        let Self {
            config,
            hypotheses,
            children,
            candidates,
            misses,
            costs,
            best,
            ..
        } = self;
        let scan = Scan {
            candidates,
            gains: &self.gains,
            log_clutter: self.log_clutter,
        };
        let least = config.least_weight.ln();
        let most = config.hypotheses;
        children.clear();
        for (parent, hypothesis) in hypotheses.iter().enumerate() {
            let tracks = hypothesis.tracks().iter();
            let base = hypothesis.log_weight + tracks.map(|t| misses[usize::from(*t)]).sum::<f64>();
            let rows = scan.rows(hypothesis, count);
            let columns = scan.fill_costs(hypothesis, &rows, costs);
            best.each(costs, |cost, assigned| {
                let log_weight = base - cost;
                let bar = children
                    .first()
                    .map_or(f64::NEG_INFINITY, |child| child.log_weight + least);
                let is_full = children.len() == most;
                let is_last = |last: &Child| log_weight <= last.log_weight;
                if log_weight < bar || (is_full && children.last().is_some_and(is_last)) {
                    return false;
                }
                let mut child = Child::of(&columns, &rows, assigned, candidates);
                (child.parent, child.log_weight) = (parent, log_weight);
                let place = children.partition_point(|other| other.log_weight >= log_weight);
                children.truncate(most - 1);
                children.insert(place.min(children.len()), child);
                true
            });
        }
        if let Some(best) = children.first().map(|child| child.log_weight) {
            children.retain(|child| child.log_weight >= best + least);
        }
    }
}

impl Scan<'_> {
    fn gain(&self, track: u16, circle: usize) -> f64 {
        self.gains[usize::from(track) * MAX_CIRCLES + circle]
    }

    /// Returns the birth candidates of a right circle whose left circle has no track in the hypothesis.
    fn births_of<'a>(
        &'a self,
        hypothesis: &'a Hypothesis,
        circle: usize,
    ) -> impl Iterator<Item = &'a Candidate> {
        let is_free = |candidate: &&Candidate| hypothesis.used >> candidate.left & 1 == 0;
        let candidates = self.candidates.iter().filter(is_free);
        candidates.filter(move |candidate| candidate.right == circle)
    }

    fn rows(&self, hypothesis: &Hypothesis, count: usize) -> CircleRows {
        let mut rows = CircleRows {
            circles: [0; MAX_CIRCLES],
            count: 0,
        };
        for circle in 0..count {
            let mut tracks = hypothesis.tracks().iter();
            if tracks.any(|track| self.gain(*track, circle).is_finite())
                || self.births_of(hypothesis, circle).next().is_some()
            {
                rows.circles[rows.count] = circle;
                rows.count += 1;
            }
        }
        rows
    }

    fn fill_costs(&self, hypothesis: &Hypothesis, rows: &CircleRows, costs: &mut Costs) -> Columns {
        let tracks = hypothesis.tracks();
        let lefts = tracks.len();
        let has_births = !self.candidates.is_empty();
        let clutter = lefts + if has_births { MAX_CIRCLES } else { 0 };
        costs.reset(rows.count, clutter + rows.count);
        for (row, circle) in rows.circles().iter().enumerate() {
            for (column, track) in tracks.iter().enumerate() {
                costs.set(row, column, -self.gain(*track, *circle));
            }
            for candidate in self.births_of(hypothesis, *circle) {
                let cost = 2.0 * self.log_clutter - candidate.birth.log_density;
                costs.set(row, lefts + candidate.left, cost);
            }
            costs.set(row, clutter + row, 0.0);
        }
        Columns { lefts, clutter }
    }
}

impl Child {
    /// Converts the columns assigned to the rows to circles of tracks and births. Parent and weight are unset.
    fn of(columns: &Columns, rows: &CircleRows, assigned: &[u8], candidates: &[Candidate]) -> Self {
        let mut child = Self {
            parent: 0,
            log_weight: 0.0,
            circles: [NONE; MAX_TRACKS],
            births: [NONE; MAX_TRACKS],
            born: 0,
        };
        for (circle, column) in rows.circles().iter().zip(assigned) {
            let column = usize::from(*column);
            if column < columns.lefts {
                child.circles[column] = *circle as u16;
            } else if column < columns.clutter && child.born < MAX_TRACKS {
                let pair = (column - columns.lefts, *circle);
                let is_pair = |candidate: &Candidate| (candidate.left, candidate.right) == pair;
                if let Some(born) = candidates.iter().position(is_pair) {
                    child.births[child.born] = born as u16;
                    child.born += 1;
                }
            }
        }
        child
    }
}
