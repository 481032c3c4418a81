//! Embedding of the 36 materials in a latent space, in which materials that the real network confuses are close.
//!
//! From the published confusion matrix `C` (rows are the true material, shares of the row), the symmetrised confusion
//! of two materials `p = (C_ij + C_ji) / 2` becomes a distance: two normal classes of unit variance, `d` apart, are
//! confused at most with `p = exp(-d^2 / 8) / 2` (Chernoff's bound), so
//!
//! ```text
//! d_ij = sqrt(-8 ln(2 p_ij))         where p_ij > 0.002
//! d_ij >= sqrt(-8 ln(0.004)) = 6.65  otherwise
//! ```
//!
//! 0.002 is half a grey level in one of the two cells: below it the published figure shows no confusion. The points
//! minimise the raw stress of these distances and bounds by majorisation (SMACOF, de Leeuw 1977): a bound that is
//! satisfied contributes its present distance as target. The best of several random starts is rotated to its principal
//! axes, each pointing to its most distant material, so the result does not depend on the rotation of the starts.

use super::gaussian::normal;
use crate::Seed;

/// Number of dimensions of the latent space: fewer increase the stress (rms 0.42 at 3, 0.12 at 6), more hardly reduce it.
pub(super) const DIMENSIONS: usize = 6;

/// Number of materials in the published matrix.
pub(super) const MATERIALS: usize = 36;

/// Point of the latent space; one unit is one standard deviation of a class with the published confusions.
pub(super) type Latent = [f64; DIMENSIONS];

/// Smallest confusion that the published figure shows, as a share.
const FLOOR: f64 = 0.002;
/// Number of random starts of the stress minimisation.
const STARTS: usize = 8;
/// Number of Guttman transforms per start.
const STEPS: usize = 300;

/// `[36][36]` confusion of TactNet-II on TactMat, read off the pixels of the published figure; see `README.md` in this
/// folder.
const PUBLISHED: &str = include_str!("tactmat_confusion_robot.csv");

/// Returns the published confusion matrix: rows are true materials, columns predictions, as shares of the row.
///
/// Source: the 36x36 confusion figure of TactNet-II, Tulbure and Bäuml, Humanoids 2018, read off its pixels (8-bit grey,
/// +-0.004).
pub fn published_confusions() -> Vec<[f64; MATERIALS]> {
    let rows: Vec<[f64; MATERIALS]> = PUBLISHED
        .lines()
        .map(|line| {
            let mut row = [f64::NAN; MATERIALS];
            for (cell, text) in row.iter_mut().zip(line.split(',')) {
                *cell = text.trim().parse().unwrap_or(f64::NAN);
            }
            row
        })
        .collect();
    assert!(
        rows.len() == MATERIALS && rows.iter().flatten().all(|share| share.is_finite()),
        "the embedded confusion matrix has {MATERIALS} rows of {MATERIALS} numbers"
    );
    rows
}

/// Target of the distance of one pair.
#[derive(Clone, Copy)]
enum Target {
    Distance(f64),
    AtLeast(f64),
}

/// Returns the `[36]` points, centred, in their principal axes (widest first).
pub(super) fn embed() -> Vec<Latent> {
    let targets = targets(&published_confusions());
    let Some((_, best)) = (0..STARTS)
        .map(|start| {
            let mut rng = Seed(0).rng(("twin-embedding", start));
            let mut points: Vec<Latent> = (0..MATERIALS)
                .map(|_| std::array::from_fn(|_| 3.0 * normal(&mut rng)))
                .collect();
            for _ in 0..STEPS {
                points = majorise(&points, &targets);
            }
            (stress(&points, &targets), points)
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
    else {
        unreachable!("there are {STARTS} starts")
    };
    principal_axes(&best)
}

fn targets(confusions: &[[f64; MATERIALS]]) -> Vec<Vec<Target>> {
    let distance = |p: f64| (-8.0 * (2.0 * p.min(0.5)).ln()).sqrt();
    (0..MATERIALS)
        .map(|i| {
            (0..MATERIALS)
                .map(|j| match (confusions[i][j] + confusions[j][i]) / 2.0 {
                    p if p > FLOOR => Target::Distance(distance(p)),
                    _ => Target::AtLeast(distance(FLOOR)),
                })
                .collect()
        })
        .collect()
}

fn distance(a: &Latent, b: &Latent) -> f64 {
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).powi(2))
        .sum::<f64>()
        .sqrt()
}

fn wanted(target: Target, present: f64) -> f64 {
    match target {
        Target::Distance(distance) => distance,
        Target::AtLeast(bound) => present.max(bound),
    }
}

/// Returns the points after one Guttman transform with equal weights: `X' = B(X) X / n`.
fn majorise(points: &[Latent], targets: &[Vec<Target>]) -> Vec<Latent> {
    (0..points.len())
        .map(|i| {
            let mut moved = [0.0; DIMENSIONS];
            for j in (0..points.len()).filter(|&j| j != i) {
                let present = distance(&points[i], &points[j]).max(1e-9);
                let ratio = wanted(targets[i][j], present) / present;
                for (k, coordinate) in moved.iter_mut().enumerate() {
                    *coordinate += ratio * (points[i][k] - points[j][k]) / points.len() as f64;
                }
            }
            moved
        })
        .collect()
}

/// Returns the root mean square of distance minus target over all pairs.
fn stress(points: &[Latent], targets: &[Vec<Target>]) -> f64 {
    let pairs = (0..points.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let squares: Vec<f64> = pairs
        .map(|(i, j)| {
            let present = distance(&points[i], &points[j]);
            (present - wanted(targets[i][j], present)).powi(2)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

fn principal_axes(points: &[Latent]) -> Vec<Latent> {
    let n = points.len() as f64;
    let mean: Latent = std::array::from_fn(|k| points.iter().map(|p| p[k]).sum::<f64>() / n);
    let covariance = std::array::from_fn(|k| {
        std::array::from_fn(|l| {
            points
                .iter()
                .map(|p| (p[k] - mean[k]) * (p[l] - mean[l]))
                .sum::<f64>()
                / n
        })
    });
    let axes = eigenvectors(covariance);
    let mut turned: Vec<Latent> = points
        .iter()
        .map(|p| {
            std::array::from_fn(|axis| {
                (0..DIMENSIONS)
                    .map(|k| axes[axis][k] * (p[k] - mean[k]))
                    .sum()
            })
        })
        .collect();
    for axis in 0..DIMENSIONS {
        let farthest = turned
            .iter()
            .map(|p| p[axis])
            .max_by(|a, b| a.abs().total_cmp(&b.abs()));
        if farthest.is_some_and(|x| x < 0.0) {
            turned.iter_mut().for_each(|p| p[axis] = -p[axis]);
        }
    }
    turned
}

/// Returns the eigenvectors (as rows) of a symmetric matrix, largest eigenvalue first, by cyclic Jacobi rotations.
fn eigenvectors(mut a: [Latent; DIMENSIONS]) -> [Latent; DIMENSIONS] {
    let mut vectors: [Latent; DIMENSIONS] =
        std::array::from_fn(|i| std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 }));
    /// Number of Jacobi sweeps over all pairs of axes.
    const ROUNDS: usize = 30;
    for _ in 0..ROUNDS {
        for p in 0..DIMENSIONS {
            for q in p + 1..DIMENSIONS {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let tan = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let cos = 1.0 / (tan * tan + 1.0).sqrt();
                let sin = tan * cos;
                for row in &mut a {
                    (row[p], row[q]) = (cos * row[p] - sin * row[q], sin * row[p] + cos * row[q]);
                }
                for k in 0..DIMENSIONS {
                    (a[p][k], a[q][k]) =
                        (cos * a[p][k] - sin * a[q][k], sin * a[p][k] + cos * a[q][k]);
                    (vectors[p][k], vectors[q][k]) = (
                        cos * vectors[p][k] - sin * vectors[q][k],
                        sin * vectors[p][k] + cos * vectors[q][k],
                    );
                }
            }
        }
    }
    let mut order: [usize; DIMENSIONS] = std::array::from_fn(|k| k);
    order.sort_by(|&i, &j| a[j][j].total_cmp(&a[i][i]));
    order.map(|k| vectors[k])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_rows_are_shares() {
        for row in published_confusions() {
            let sum: f64 = row.iter().sum();
            assert!((0.96..=1.01).contains(&sum), "{sum}");
        }
    }

    #[test]
    fn confused_materials_are_close_and_the_others_are_not() {
        let points = embed();
        let targets = targets(&published_confusions());
        let stress = stress(&points, &targets);
        assert!(stress < 0.16, "rms stress {stress}");
        // Synthetic leather rough and smooth reverse are confused most; cork and metallic grid never.
        assert!(distance(&points[0], &points[1]) < 3.5);
        assert!(distance(&points[23], &points[30]) > 6.0);
    }

    #[test]
    fn axes_are_uncorrelated_and_ordered() {
        let points = embed();
        let moment = |k: usize, l: usize| {
            points.iter().map(|p| p[k] * p[l]).sum::<f64>() / points.len() as f64
        };
        for k in 0..DIMENSIONS {
            for l in 0..k {
                assert!(
                    moment(k, l).abs() < 1e-9,
                    "axes {k} and {l}: {}",
                    moment(k, l)
                );
                assert!(moment(k, k) <= moment(l, l));
            }
        }
    }
}
