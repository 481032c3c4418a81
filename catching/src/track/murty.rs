//! The k best assignments (Murty 1968). Each row of a cost matrix gets its own column such that the sum of costs is
//! minimal, then second to minimal, and so on. Single assignments use shortest augmenting paths (Jonker and Volgenant
//! 1987, without their initialisation).

/// Maximum number of rows.
pub const MAX_ROWS: usize = 32;
/// Maximum number of columns, so that a set of columns fits into a `u128`.
pub const MAX_COLUMNS: usize = 128;

/// Matrix of assignment costs; infinite for forbidden assignments.
#[derive(Debug, Clone)]
pub struct Costs {
    rows: usize,
    columns: usize,
    values: Vec<f64>,
}

impl Default for Costs {
    fn default() -> Self {
        Self {
            rows: 0,
            columns: 0,
            values: vec![f64::INFINITY; MAX_ROWS * MAX_COLUMNS],
        }
    }
}

impl Costs {
    /// Resets to a matrix without permitted assignments. Does not allocate.
    ///
    /// # Panics
    /// Panics with more than [`MAX_ROWS`] rows or [`MAX_COLUMNS`] columns.
    pub fn reset(&mut self, rows: usize, columns: usize) {
        assert!(
            rows <= MAX_ROWS && columns <= MAX_COLUMNS,
            "at most 32 rows, 128 columns"
        );
        (self.rows, self.columns) = (rows, columns);
        self.values[..rows * columns].fill(f64::INFINITY);
    }

    /// Sets a cost. A finite cost permits the assignment.
    pub fn set(&mut self, row: usize, column: usize, cost: f64) {
        self.values[row * self.columns + column] = cost;
    }

    fn get(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.columns + column]
    }
}

/// Assignment whose first `fixed` rows are fixed and whose row `fixed` must not use the columns in `forbidden`.
#[derive(Debug, Clone, Copy)]
struct Node {
    cost: f64,
    columns: [u8; MAX_ROWS],
    fixed: usize,
    forbidden: u128,
}

/// Solver with its working memory.
#[derive(Debug, Clone)]
pub struct KBest {
    /// Best remaining assignments, sorted by cost; ties in order of discovery.
    nodes: Vec<Node>,
    most: usize,
}

impl KBest {
    /// Creates a solver for up to `most` assignments.
    pub fn new(most: usize) -> Self {
        Self {
            nodes: Vec::with_capacity(most + 1),
            most,
        }
    }

    /// Calls `found` with cost and columns of the best assignment, the second best, and so on. It stops when `found`
    /// returns false, no assignments remain, or after `most` calls. Does not allocate.
    pub fn each(&mut self, costs: &Costs, mut found: impl FnMut(f64, &[u8]) -> bool) {
        self.nodes.clear();
        let start = Node {
            cost: 0.0,
            columns: [0; MAX_ROWS],
            fixed: 0,
            forbidden: 0,
        };
        self.nodes.extend(solve(costs, &start));
        for given in 0..self.most {
            if self.nodes.is_empty() {
                return;
            }
            let best = self.nodes.remove(0);
            if !found(best.cost, &best.columns[..costs.rows]) {
                return;
            }
            let room = self.most - given - 1;
            for row in best.fixed..costs.rows {
                let mut forbidden = 1u128 << best.columns[row];
                if row == best.fixed {
                    forbidden |= best.forbidden;
                }
                let part = Node {
                    fixed: row,
                    forbidden,
                    ..best
                };
                let Some(node) = solve(costs, &part) else {
                    continue;
                };
                let place = self.nodes.partition_point(|other| other.cost <= node.cost);
                if place < room {
                    self.nodes.truncate(room - 1);
                    self.nodes.insert(place, node);
                }
            }
        }
    }
}

/// Index that stands for no row or no column.
const NONE: usize = usize::MAX;

/// Partial assignment with the dual potentials of its rows and columns.
struct Paths {
    of_row: [f64; MAX_ROWS],
    of_column: [f64; MAX_COLUMNS],
    row_of: [usize; MAX_COLUMNS],
}

impl Paths {
    /// Assigns row `first` along the shortest augmenting path. Returns `None` if there is no such path.
    fn augment(
        &mut self,
        first: usize,
        columns: usize,
        cost: impl Fn(usize, usize) -> f64,
    ) -> Option<()> {
        let Self {
            of_row,
            of_column,
            row_of,
        } = self;
        let mut least = [f64::INFINITY; MAX_COLUMNS];
        let mut before = [NONE; MAX_COLUMNS];
        let mut done = [false; MAX_COLUMNS];
        let (mut row, mut last) = (first, NONE);
        let end = loop {
            let mut next = NONE;
            for column in 0..columns {
                if done[column] {
                    continue;
                }
                let reduced = cost(row, column) - of_row[row] - of_column[column];
                if reduced < least[column] {
                    least[column] = reduced;
                    before[column] = last;
                }
                if least[column].is_finite() && (next == NONE || least[column] < least[next]) {
                    next = column;
                }
            }
            if next == NONE {
                return None;
            }
            // Update the potentials: reduced costs along the shortest paths become zero.
            let step = least[next];
            of_row[first] += step;
            for column in 0..columns {
                if done[column] {
                    of_row[row_of[column]] += step;
                    of_column[column] -= step;
                } else {
                    least[column] -= step;
                }
            }
            done[next] = true;
            if row_of[next] == NONE {
                break next;
            }
            (row, last) = (row_of[next], next);
        };
        let mut column = end;
        while before[column] != NONE {
            row_of[column] = row_of[before[column]];
            column = before[column];
        }
        row_of[column] = first;
        Some(())
    }
}

/// Returns the best assignment within `part`.
fn solve(costs: &Costs, part: &Node) -> Option<Node> {
    let (rows, columns) = (costs.rows, costs.columns);
    let mut taken = 0u128;
    for row in 0..part.fixed {
        taken |= 1 << part.columns[row];
    }
    let cost = |row: usize, column: usize| {
        let forbidden = taken | if row == part.fixed { part.forbidden } else { 0 };
        if forbidden >> column & 1 == 1 {
            f64::INFINITY
        } else {
            costs.get(row, column)
        }
    };
    let mut paths = Paths {
        of_row: [0.0; MAX_ROWS],
        of_column: [0.0; MAX_COLUMNS],
        row_of: [NONE; MAX_COLUMNS],
    };
    for first in part.fixed..rows {
        paths.augment(first, columns, cost)?;
    }
    let row_of = &paths.row_of;
    let mut node = *part;
    for column in 0..columns {
        if row_of[column] != NONE {
            node.columns[row_of[column]] = column as u8;
        }
    }
    node.cost = (0..rows)
        .map(|row| costs.get(row, usize::from(node.columns[row])))
        .sum();
    Some(node)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(
        costs: &Costs,
        row: usize,
        columns: &mut Vec<u8>,
        all: &mut Vec<(f64, Vec<u8>)>,
    ) {
        if row == costs.rows {
            let sum: f64 = (0..row)
                .map(|row| costs.get(row, usize::from(columns[row])))
                .sum();
            if sum.is_finite() {
                all.push((sum, columns.clone()));
            }
            return;
        }
        for column in 0..costs.columns as u8 {
            if !columns.contains(&column) {
                columns.push(column);
                brute_force(costs, row + 1, columns, all);
                columns.pop();
            }
        }
    }

    proptest! {
        #[test]
        fn the_best_assignments_are_those_of_brute_force(
            rows in 0..5usize,
            more in 0..4usize,
            values in proptest::collection::vec(prop_oneof![3 => -5.0..5.0f64, 1 => Just(f64::INFINITY)], 5 * 9),
            k in 1..30usize,
        ) {
            let columns = rows + more;
            let mut costs = Costs::default();
            costs.reset(rows, columns);
            for row in 0..rows {
                for column in 0..columns {
                    costs.set(row, column, values[row * columns + column]);
                }
            }
            let mut all = Vec::new();
            brute_force(&costs, 0, &mut Vec::new(), &mut all);
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let mut found = Vec::new();
            KBest::new(k).each(&costs, |cost, columns| {
                found.push((cost, columns.to_vec()));
                true
            });
            prop_assert_eq!(found.len(), all.len().min(k));
            for ((cost, columns), (expected, _)) in found.iter().zip(&all) {
                prop_assert!((cost - expected).abs() < 1e-12, "{} {}", cost, expected);
                prop_assert!(all.iter().any(|(_, other)| other == columns));
            }
            found.sort_by(|a, b| a.1.cmp(&b.1));
            found.dedup_by(|a, b| a.1 == b.1);
            prop_assert_eq!(found.len(), all.len().min(k));
        }
    }

    #[test]
    fn no_more_are_sought_than_are_wanted() {
        let mut costs = Costs::default();
        costs.reset(3, 6);
        for row in 0..3 {
            for column in 0..6 {
                costs.set(row, column, (row * 7 + column * 3 % 5) as f64);
            }
        }
        let mut calls = 0;
        KBest::new(20).each(&costs, |_, _| {
            calls += 1;
            calls < 4
        });
        assert_eq!(calls, 4);
    }
}
