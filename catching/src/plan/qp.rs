//! Solver for small dense quadratic programs with the dual active-set method (Goldfarb & Idnani 1983), on the stack.
//!
//! ```text
//! minimise  x'Bx / 2 + g'x      subject to  n_i'x = b_i (the first rows),   n_i'x >= b_i (the others)
//! ```
//!
//! The method starts at the unconstrained minimum and adds violated rows one by one. It needs no feasible start, and an
//! inactive row costs one scalar product.

/// Constraint: `normal . x` compared with `bound`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<const N: usize> {
    /// Normal `n_i`.
    pub normal: [f64; N],
    /// Bound `b_i`.
    pub bound: f64,
}

/// Reason why a problem cannot be solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoSolution {
    /// The matrix is not positive definite, or a value is not finite.
    NotConvex,
    /// No point satisfies all rows, or an equality depends on the others.
    Infeasible,
    /// Rounding prevents convergence.
    Cycles,
}

/// Solution of a quadratic program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution<const N: usize, const ROWS: usize> {
    /// Minimum.
    pub x: [f64; N],
    /// Lagrange multiplier of each row. Multipliers of inequalities are non-negative, and 0 if inactive.
    pub multipliers: [f64; ROWS],
}

/// Tolerance for violations, for rows of about unit length.
const FEASIBLE: f64 = 1e-10;
/// Squared length below which a direction counts as zero.
const NO_DIRECTION: f64 = 1e-14;

/// Solves a quadratic program whose first `equalities` rows are equations. `ROWS` is the maximum number of rows.
///
/// # Errors
/// Returns the reason why the problem cannot be solved.
pub fn solve<const N: usize, const ROWS: usize>(
    b: &[[f64; N]; N],
    g: &[f64; N],
    rows: &[Row<N>],
    equalities: usize,
) -> Result<Solution<N, ROWS>, NoSolution> {
    debug_assert!(rows.len() <= ROWS && equalities <= N);
    let mut set = ActiveSet::new(b, g)?;
    let mut active = [false; ROWS];
    let mut steps = 0;
    for (i, row) in rows[..equalities].iter().enumerate() {
        let direction = set.direction(&row.normal);
        if direction.length < NO_DIRECTION {
            return Err(NoSolution::Infeasible);
        }
        let t = (row.bound - dot(&row.normal, &set.x)) / dot(&direction.z, &row.normal);
        set.advance(&direction, t);
        if !set.add(&direction.d, i, t) {
            return Err(NoSolution::Infeasible);
        }
        active[i] = true;
        steps += 1;
    }
    while let Some(worst) = most_violated(rows, &active, &set.x, equalities) {
        enforce(&mut set, rows, worst, equalities, &mut active, &mut steps)?;
    }
    let mut multipliers = [0.0; ROWS];
    for k in 0..set.count {
        multipliers[set.rows[k]] = set.u[k];
    }
    if set.x.iter().any(|x| !x.is_finite()) {
        return Err(NoSolution::NotConvex);
    }
    Ok(Solution {
        x: set.x,
        multipliers,
    })
}

/// Adds the violated row `worst` to the active set and drops rows whose multipliers become negative.
fn enforce<const N: usize, const ROWS: usize>(
    set: &mut ActiveSet<N>,
    rows: &[Row<N>],
    worst: usize,
    equalities: usize,
    active: &mut [bool; ROWS],
    steps: &mut usize,
) -> Result<(), NoSolution> {
    let row = &rows[worst];
    let mut multiplier = 0.0;
    loop {
        *steps += 1;
        if *steps > 20 * (N + ROWS) {
            return Err(NoSolution::Cycles);
        }
        let direction = set.direction(&row.normal);
        // Step length at which the multiplier of an active inequality becomes 0.
        let mut partial = f64::INFINITY;
        let mut dropped = 0;
        for k in equalities..set.count {
            if direction.r[k] > 0.0 && set.u[k] / direction.r[k] < partial {
                partial = set.u[k] / direction.r[k];
                dropped = k;
            }
        }
        let full = if direction.length < NO_DIRECTION {
            f64::INFINITY
        } else {
            (row.bound - dot(&row.normal, &set.x)) / dot(&direction.z, &row.normal)
        };
        let t = partial.min(full);
        if t.is_infinite() {
            return Err(NoSolution::Infeasible);
        }
        if full.is_finite() {
            set.advance(&direction, t);
        } else {
            set.reweigh(&direction, t);
        }
        multiplier += t;
        if t == full {
            if !set.add(&direction.d, worst, multiplier) {
                return Err(NoSolution::Infeasible);
            }
            active[worst] = true;
            return Ok(());
        }
        active[set.rows[dropped]] = false;
        set.drop(dropped);
    }
}

fn most_violated<const N: usize>(
    rows: &[Row<N>],
    active: &[bool],
    x: &[f64; N],
    equalities: usize,
) -> Option<usize> {
    let mut worst = (None, -FEASIBLE);
    for (i, row) in rows.iter().enumerate().skip(equalities) {
        if !active[i] {
            let slack = dot(&row.normal, x) - row.bound;
            if slack < worst.1 {
                worst = (Some(i), slack);
            }
        }
    }
    worst.0
}

/// Factors of the active rows: `J = L^-T Q`, where `B = L L'` and `Q` transforms the active normals to the upper
/// triangular `R`.
struct ActiveSet<const N: usize> {
    x: [f64; N],
    j: [[f64; N]; N],
    r: [[f64; N]; N],
    u: [f64; N],
    rows: [usize; N],
    count: usize,
}

/// Direction of the minimum when one more row is enforced.
struct Direction<const N: usize> {
    d: [f64; N],
    z: [f64; N],
    r: [f64; N],
    length: f64,
}

impl<const N: usize> ActiveSet<N> {
    fn new(b: &[[f64; N]; N], g: &[f64; N]) -> Result<Self, NoSolution> {
        let mut l = [[0.0; N]; N];
        for i in 0..N {
            for k in 0..=i {
                let sum: f64 = b[i][k] - (0..k).map(|m| l[i][m] * l[k][m]).sum::<f64>();
                if i == k {
                    if !(sum > 0.0 && sum.is_finite()) {
                        return Err(NoSolution::NotConvex);
                    }
                    l[i][i] = sum.sqrt();
                } else {
                    l[i][k] = sum / l[k][k];
                }
            }
        }
        // L^-T, upper triangular: column c solves L'y = e_c.
        let mut j = [[0.0; N]; N];
        for c in 0..N {
            for i in (0..=c).rev() {
                let unit = if i == c { 1.0 } else { 0.0 };
                let sum: f64 = (i + 1..=c).map(|m| l[m][i] * j[m][c]).sum();
                j[i][c] = (unit - sum) / l[i][i];
            }
        }
        let mut set = Self {
            x: [0.0; N],
            j,
            r: [[0.0; N]; N],
            u: [0.0; N],
            rows: [0; N],
            count: 0,
        };
        let back: [f64; N] = std::array::from_fn(|c| (0..N).map(|i| set.j[i][c] * g[i]).sum());
        set.x = std::array::from_fn(|i| -(0..N).map(|c| set.j[i][c] * back[c]).sum::<f64>());
        Ok(set)
    }

    fn direction(&self, normal: &[f64; N]) -> Direction<N> {
        let d: [f64; N] = std::array::from_fn(|c| (0..N).map(|i| self.j[i][c] * normal[i]).sum());
        let z: [f64; N] =
            std::array::from_fn(|i| (self.count..N).map(|c| self.j[i][c] * d[c]).sum());
        let mut r = [0.0; N];
        for k in (0..self.count).rev() {
            let sum: f64 = (k + 1..self.count).map(|m| self.r[k][m] * r[m]).sum();
            r[k] = (d[k] - sum) / self.r[k][k];
        }
        let length = (self.count..N).map(|c| d[c] * d[c]).sum();
        Direction { d, z, r, length }
    }

    fn advance(&mut self, direction: &Direction<N>, t: f64) {
        for (x, z) in self.x.iter_mut().zip(&direction.z) {
            *x += t * z;
        }
        self.reweigh(direction, t);
    }

    fn reweigh(&mut self, direction: &Direction<N>, t: f64) {
        for k in 0..self.count {
            self.u[k] -= t * direction.r[k];
        }
    }

    /// Adds a row with `J'n = d`. Returns false if it depends on the others.
    fn add(&mut self, d: &[f64; N], row: usize, multiplier: f64) -> bool {
        if self.count == N {
            return false;
        }
        let mut d = *d;
        for c in (self.count + 1..N).rev() {
            let (cos, sin, length) = givens(d[c - 1], d[c]);
            if length == 0.0 {
                continue;
            }
            (d[c - 1], d[c]) = (length, 0.0);
            for line in &mut self.j {
                let (a, b) = (line[c - 1], line[c]);
                (line[c - 1], line[c]) = (cos * a + sin * b, cos * b - sin * a);
            }
        }
        if d[self.count].abs() < 1e-12 {
            return false;
        }
        for (k, d) in d.iter().enumerate().take(self.count + 1) {
            self.r[k][self.count] = *d;
        }
        self.rows[self.count] = row;
        self.u[self.count] = multiplier;
        self.count += 1;
        true
    }

    fn drop(&mut self, k: usize) {
        for c in k..self.count - 1 {
            for line in &mut self.r {
                line[c] = line[c + 1];
            }
            self.rows[c] = self.rows[c + 1];
            self.u[c] = self.u[c + 1];
        }
        self.count -= 1;
        for c in k..self.count {
            let (cos, sin, length) = givens(self.r[c][c], self.r[c + 1][c]);
            if length == 0.0 {
                continue;
            }
            for m in c..self.count {
                let (a, b) = (self.r[c][m], self.r[c + 1][m]);
                (self.r[c][m], self.r[c + 1][m]) = (cos * a + sin * b, cos * b - sin * a);
            }
            for line in &mut self.j {
                let (a, b) = (line[c], line[c + 1]);
                (line[c], line[c + 1]) = (cos * a + sin * b, cos * b - sin * a);
            }
        }
    }
}

fn givens(a: f64, b: f64) -> (f64, f64, f64) {
    let length = a.hypot(b);
    if length == 0.0 {
        (1.0, 0.0, 0.0)
    } else {
        (a / length, b / length, length)
    }
}

fn dot<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns the step that minimises violations of rows in the least-squares sense without violating the others.
///
/// - `lack`: violation of a row, by its number; `None` for rows that must hold
/// - `equalities`: number of equations at the beginning of the rows that must hold
pub(crate) fn least_violation<const N: usize, const R: usize>(
    rows: &[Row<N>],
    lack: impl Fn(usize, &Row<N>) -> Option<f64>,
    equalities: usize,
) -> Option<[f64; N]> {
    let mut b = [[0.0; N]; N];
    let mut g = [0.0; N];
    for (i, line) in b.iter_mut().enumerate() {
        line[i] = 1e-3;
    }
    let none = Row {
        normal: [0.0; N],
        bound: 0.0,
    };
    let (mut held, mut count) = ([none; R], 0);
    for (i, row) in rows.iter().enumerate() {
        let Some(lack) = lack(i, row) else {
            held[count] = *row;
            count += 1;
            continue;
        };
        for k in 0..N {
            g[k] -= lack * row.normal[k];
            for m in 0..N {
                b[k][m] += row.normal[k] * row.normal[m];
            }
        }
    }
    Some(solve::<N, R>(&b, &g, &held[..count], equalities).ok()?.x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const N: usize = 8;
    const ROWS: usize = 40;

    #[derive(Debug)]
    struct Problem {
        b: [[f64; N]; N],
        g: [f64; N],
        rows: Vec<Row<N>>,
        equalities: usize,
    }

    fn vector() -> impl Strategy<Value = [f64; N]> {
        proptest::array::uniform8(-1.0..1.0f64)
    }

    /// Problems with a point that satisfies all rows, some of them without slack.
    fn feasible() -> impl Strategy<Value = Problem> {
        (
            proptest::collection::vec(vector(), N),
            vector(),
            proptest::collection::vec((vector(), 0.0..1.0f64), 0..ROWS),
            0..6usize,
            vector(),
            0.001..0.3f64,
        )
            .prop_map(|(factors, g, rows, equalities, inside, ridge)| {
                let mut b = [[0.0; N]; N];
                for i in 0..N {
                    for k in 0..N {
                        b[i][k] = factors.iter().map(|f| f[i] * f[k]).sum::<f64>();
                    }
                    b[i][i] += ridge;
                }
                let equalities = equalities.min(rows.len());
                let rows = rows
                    .into_iter()
                    .enumerate()
                    .map(|(i, (normal, slack))| {
                        let slack = if i < equalities || slack < 0.3 {
                            0.0
                        } else {
                            slack
                        };
                        Row {
                            normal,
                            bound: dot(&normal, &inside) - slack,
                        }
                    })
                    .collect();
                Problem {
                    b,
                    g,
                    rows,
                    equalities,
                }
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// For a convex program, these conditions are necessary and sufficient.
        #[test]
        fn the_solution_satisfies_the_conditions_of_karush_kuhn_and_tucker(problem in feasible()) {
            let Problem { b, g, rows, equalities } = problem;
            let solution = solve::<N, ROWS>(&b, &g, &rows, equalities).unwrap();
            for i in 0..N {
                let slope = dot(&b[i], &solution.x) + g[i];
                let pull: f64 = rows.iter().zip(&solution.multipliers).map(|(row, u)| u * row.normal[i]).sum();
                let scale = 1.0 + solution.multipliers.iter().fold(0.0f64, |a, u| a.max(u.abs()));
                prop_assert!((slope - pull).abs() < 1e-7 * scale, "{slope} {pull}");
            }
            for (i, row) in rows.iter().enumerate() {
                let slack = dot(&row.normal, &solution.x) - row.bound;
                if i < equalities {
                    prop_assert!(slack.abs() < 1e-7, "{slack}");
                } else {
                    prop_assert!(slack > -1e-7 && solution.multipliers[i] >= 0.0, "{slack}");
                    prop_assert!(solution.multipliers[i] == 0.0 || slack.abs() < 1e-7);
                }
            }
        }

        #[test]
        fn rows_that_exclude_each_other_are_found(problem in feasible(), gap in 1e-6..1.0f64) {
            let Problem { b, g, mut rows, equalities } = problem;
            prop_assume!(!rows.is_empty());
            let opposite = rows[0];
            rows.truncate(ROWS - 1);
            rows.push(Row { normal: opposite.normal.map(|x| -x), bound: -opposite.bound + gap });
            prop_assert!(solve::<N, ROWS>(&b, &g, &rows, equalities.max(1)).is_err());
        }
    }

    #[test]
    fn a_matrix_that_is_not_convex_is_refused() {
        let mut b = [[0.0; 2]; 2];
        let refused = solve::<2, 1>(&b, &[1.0, 0.0], &[], 0);
        assert_eq!(refused, Err(NoSolution::NotConvex));
        b = [[f64::NAN, 0.0], [0.0, 1.0]];
        let refused = solve::<2, 1>(&b, &[1.0, 0.0], &[], 0);
        assert_eq!(refused, Err(NoSolution::NotConvex));
    }
}
