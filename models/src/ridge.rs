//! Ridge classifier on random-convolution features, with a penalty chosen by closed-form leave-one-out cross-validation.
//!
//! Each material has one target column: +1 for the material, else -1 (Dempster et al., 2020; scikit-learn's `RidgeClassifierCV`).
//! There are more features than sweeps, so the fit uses the Gram matrix `K = X X^T = Q diag(w) Q^T` of the centred features.
//! The dual weights are `c = Q diag(1/(w + penalty)) Q^T y`. The leave-one-out residual of sweep `i` is `c_i / G_ii` with
//! `G = (K + penalty)^-1` (Rifkin & Lippert, 2007). The intercept is not penalised: targets are centred, and the vector of ones, an
//! eigenvector of `K` with eigenvalue 0, is removed from `G`.
//!
//! Weights of sweeps are those of weighted least squares: means are weighted, and rows and targets are multiplied by the roots `s` of the weights,
//! so that `K = diag(s) X X^T diag(s)`. The vector `s` takes the place of the vector of ones.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatMut, MatRef, Par, Side};

use crate::{Features, ModelError};

/// Number of columns that are multiplied in single precision before their sums are added in double precision.
const COLUMNS: usize = 2048;

/// Returns the default penalties, `10^-3 … 10^5`.
///
/// The first ten are aeon's logarithmic steps up to `10^3`; scaled features of noisy sweeps need the three stronger ones.
pub fn default_penalties() -> Vec<f64> {
    (0..13)
        .map(|i| 10.0_f64.powf(-3.0 + 6.0 * f64::from(i) / 9.0))
        .collect()
}

/// Fitted ridge classifier.
#[derive(Debug, Clone, PartialEq)]
pub struct Ridge {
    /// `[materials][width]`
    pub coefficients: Vec<f32>,
    /// `[materials]`
    pub intercepts: Vec<f64>,
    /// Penalty with the smallest leave-one-out residual.
    pub penalty: f64,
}

/// Gram matrix of training sweeps: dot products of all pairs, `[sweeps][sweeps]`, in `f64`.
#[derive(Debug, Clone)]
pub struct Gram(Mat<f64>);

/// Labels of sweeps, and settings of the fit to them.
#[derive(Debug, Clone, Copy)]
pub struct RidgeTargets<'a> {
    /// `[sweeps]`, below `materials`
    pub labels: &'a [usize],
    /// Number of materials.
    pub materials: usize,
    /// Weight of each sweep, positive; `None`: all are equal.
    pub weights: Option<&'a [f64]>,
    /// Candidate penalties.
    pub penalties: &'a [f64],
}

impl RidgeTargets<'_> {
    /// Returns the weights of all sweeps.
    fn all_weights(&self) -> Vec<f64> {
        let equal = || vec![1.0; self.labels.len()];
        self.weights.map_or_else(equal, <[f64]>::to_vec)
    }
}

/// Returns the sum of `values` times `weights`, over the sum of the weights.
fn weighted_mean(values: impl IntoIterator<Item = f64>, weights: &[f64]) -> f64 {
    let sum: f64 = values
        .into_iter()
        .zip(weights)
        .map(|(value, weight)| value * weight)
        .sum();
    sum / weights.iter().sum::<f64>()
}

impl Gram {
    /// Returns `X X^T`, summed in double precision over blocks of columns.
    pub fn of(features: &Features) -> Self {
        let sweeps = features.len();
        let mut gram = Mat::<f64>::zeros(sweeps, sweeps);
        let mut part = Mat::<f32>::zeros(sweeps, sweeps);
        let all = MatRef::from_row_major_slice(features.values(), sweeps, features.width());
        for start in (0..features.width()).step_by(COLUMNS) {
            let count = COLUMNS.min(features.width() - start);
            let block = all.subcols(start, count);
            matmul(
                part.as_mut(),
                Accum::Replace,
                block,
                block.transpose(),
                1.0,
                Par::rayon(0),
            );
            for column in 0..sweeps {
                let sums = gram.col_as_slice_mut(column);
                for (sum, value) in sums.iter_mut().zip(part.col_as_slice(column)) {
                    *sum += f64::from(*value);
                }
            }
        }
        Self(gram)
    }

    /// Returns the Gram matrix of the sweeps at `positions`.
    pub fn select(&self, positions: &[usize]) -> Self {
        Self(Mat::from_fn(positions.len(), positions.len(), |i, j| {
            self.0[(positions[i], positions[j])]
        }))
    }

    /// Returns scores `[held][materials]` of the held-out sweeps at `held`.
    ///
    /// Classifier and penalty are fitted to the sweeps at `train` only.
    ///
    /// - `targets`: those of all sweeps
    ///
    /// # Errors
    /// The eigenvalue decomposition fails; no penalty gives a finite residual.
    pub fn held_out_scores(
        &self,
        train: &[usize],
        held: &[usize],
        targets: RidgeTargets<'_>,
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        let all = targets.all_weights();
        let labels: Vec<usize> = train.iter().map(|&at| targets.labels[at]).collect();
        let weights: Vec<f64> = train.iter().map(|&at| all[at]).collect();
        let of_train = RidgeTargets {
            labels: &labels,
            weights: Some(&weights),
            ..targets
        };
        let dual = solve(self.select(train), of_train)?;
        // W = X^T c with weights c that sum to zero, so (x - mean) W = sum over i of c_i (K_xi - mean over j of K_ji).
        let means: Vec<f64> = train
            .iter()
            .map(|&i| weighted_mean(train.iter().map(|&j| self.0[(j, i)]), &weights))
            .collect();
        let kernel = Mat::<f64>::from_fn(held.len(), train.len(), |row, column| {
            self.0[(held[row], train[column])] - means[column]
        });
        let scores = product(kernel.as_ref(), dual.weights.as_ref());
        Ok((0..held.len())
            .map(|row| {
                let targets = dual.target_means.iter().enumerate();
                targets
                    .map(|(label, mean)| scores[(row, label)] + mean)
                    .collect()
            })
            .collect())
    }

    /// Returns the Gram matrix of the features minus their weighted means, with rows and columns times the roots of the weights.
    fn centred(mut self, weights: &[f64]) -> Mat<f64> {
        let sweeps = self.0.nrows();
        let means: Vec<f64> = (0..sweeps)
            .map(|column| weighted_mean(self.0.col_as_slice(column).iter().copied(), weights))
            .collect();
        let mean = weighted_mean(means.iter().copied(), weights);
        let roots: Vec<f64> = weights.iter().map(|weight| weight.sqrt()).collect();
        for column in 0..sweeps {
            let shift = mean - means[column];
            let rows = means.iter().zip(&roots);
            for (value, (row, root)) in self.0.col_as_slice_mut(column).iter_mut().zip(rows) {
                *value = (*value + (shift - row)) * (root * roots[column]);
            }
        }
        self.0
    }
}

/// Dual weights of a fit and the penalty that gave them.
struct Dual {
    /// `[sweeps][materials]`, with which the features are multiplied
    weights: Mat<f64>,
    /// `[materials]`
    target_means: Vec<f64>,
    penalty: f64,
}

impl Ridge {
    /// Fits to `features` and their Gram matrix with the penalty that has the smallest mean squared leave-one-out residual.
    ///
    /// # Errors
    /// The eigenvalue decomposition fails; no penalty gives a finite residual.
    pub fn fit(
        features: &Features,
        gram: Gram,
        targets: RidgeTargets<'_>,
    ) -> Result<Self, ModelError> {
        let materials = targets.materials;
        let sample_weights = targets.all_weights();
        let dual = solve(gram, targets)?;
        let sweeps = features.len();
        let weights = Mat::<f32>::from_fn(sweeps, materials, |i, j| dual.weights[(i, j)] as f32);
        let width = features.width();
        let mut coefficients = vec![0.0_f32; width * materials];
        let all = MatRef::from_row_major_slice(features.values(), sweeps, width);
        matmul(
            MatMut::from_column_major_slice_mut(&mut coefficients, width, materials),
            Accum::Replace,
            all.transpose(),
            weights.as_ref(),
            1.0,
            Par::rayon(0),
        );
        let mut means = vec![0.0_f64; width];
        for (row, weight) in features.rows().zip(&sample_weights) {
            means
                .iter_mut()
                .zip(row)
                .for_each(|(m, v)| *m += weight * f64::from(*v));
        }
        let total: f64 = sample_weights.iter().sum();
        means.iter_mut().for_each(|m| *m /= total);
        let intercepts = dual
            .target_means
            .iter()
            .zip(coefficients.chunks_exact(width))
            .map(|(target, coefficients)| {
                let products = means.iter().zip(coefficients);
                target - products.map(|(m, c)| m * f64::from(*c)).sum::<f64>()
            })
            .collect();
        Ok(Self {
            coefficients,
            intercepts,
            penalty: dual.penalty,
        })
    }

    /// Returns scores `[sweeps][materials]`: about +1 for the true material, else about -1.
    ///
    /// # Panics
    /// If `queries` have another width.
    pub fn scores(&self, queries: &Features) -> Vec<Vec<f64>> {
        let materials = self.intercepts.len();
        let width = queries.width();
        assert_eq!(self.coefficients.len(), materials * width, "width of a row");
        let mut scores = vec![0.0_f32; materials * queries.len()];
        matmul(
            MatMut::from_column_major_slice_mut(&mut scores, materials, queries.len()),
            Accum::Replace,
            MatRef::from_row_major_slice(&self.coefficients, materials, width),
            MatRef::from_row_major_slice(queries.values(), queries.len(), width).transpose(),
            1.0,
            Par::rayon(0),
        );
        scores
            .chunks_exact(materials)
            .map(|row| {
                let scores = row.iter().zip(&self.intercepts);
                scores
                    .map(|(s, intercept)| f64::from(*s) + intercept)
                    .collect()
            })
            .collect()
    }
}

/// Returns the matrix product, computed on all threads; one thread sums each element.
fn product(left: MatRef<'_, f64>, right: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(left.nrows(), right.ncols());
    matmul(
        out.as_mut(),
        Accum::Replace,
        left,
        right,
        1.0,
        Par::rayon(0),
    );
    out
}

/// Returns `[sweeps][materials]` targets, 1 for the sweep's material and -1 for others, minus their weighted means, times the roots of the
/// weights; and the means.
fn centred_targets(labels: &[usize], materials: usize, weights: &[f64]) -> (Mat<f64>, Vec<f64>) {
    let sweeps = labels.len();
    let mut targets = Mat::<f64>::from_fn(sweeps, materials, |sweep, label| {
        if labels[sweep] == label { 1.0 } else { -1.0 }
    });
    let mut target_means = Vec::with_capacity(materials);
    for label in 0..materials {
        let column = targets.col_as_slice_mut(label);
        let mean = weighted_mean(column.iter().copied(), weights);
        for (target, weight) in column.iter_mut().zip(weights) {
            *target = (*target - mean) * weight.sqrt();
        }
        target_means.push(mean);
    }
    (targets, target_means)
}

/// Eigenvalues and eigenvectors of the centred Gram matrix, with the targets in its basis.
struct Decomposed {
    values: Vec<f64>,
    vectors: Mat<f64>,
    /// `[sweeps][materials]`
    projected: Mat<f64>,
    /// Squares of the eigenvectors' components.
    squares: Mat<f64>,
    /// `[sweeps]`
    weights: Vec<f64>,
}

impl Decomposed {
    /// Returns the dual weights of the scaled problem, `[sweeps][materials]`, and the sum of squared leave-one-out residuals.
    fn fit(&self, penalty: f64) -> (Mat<f64>, f64) {
        let (sweeps, materials) = (self.values.len(), self.projected.ncols());
        // Eigenvalues of a Gram matrix are not negative, except by rounding.
        let inverse: Vec<f64> = (0..sweeps)
            .map(|i| 1.0 / (self.values[i].max(0.0) + penalty))
            .collect();
        let scaled = Mat::<f64>::from_fn(sweeps, materials, |i, j| {
            self.projected[(i, j)] * inverse[i]
        });
        let dual = product(self.vectors.as_ref(), scaled.as_ref());
        let of_ones = 1.0 / (penalty * self.weights.iter().sum::<f64>());
        let inverse = Mat::<f64>::from_fn(sweeps, 1, |i, _| inverse[i]);
        let diagonal = product(self.squares.as_ref(), inverse.as_ref());
        let mut loss = 0.0;
        for sweep in 0..sweeps {
            let diagonal = diagonal[(sweep, 0)] - self.weights[sweep] * of_ones;
            loss += (0..materials)
                .map(|label| (dual[(sweep, label)] / diagonal).powi(2))
                .sum::<f64>();
        }
        (dual, loss)
    }
}

/// Returns the decomposition, and the weighted means of the targets, `[materials]`.
fn decompose(gram: Gram, targets: RidgeTargets<'_>) -> Result<(Decomposed, Vec<f64>), ModelError> {
    let weights = targets.all_weights();
    let sweeps = weights.len();
    let gram = gram.centred(&weights);
    // faer's tridiagonalisation adds one partial sum per thread. With one thread, results do not depend on the number of threads.
    faer::set_global_parallelism(Par::Seq);
    let eigen = gram
        .self_adjoint_eigen(Side::Lower)
        .map_err(|error| ModelError::Fit {
            what: "ridge classifier",
            reason: format!("no eigenvalues of the Gram matrix: {error:?}"),
        })?;
    let (vectors, values) = (eigen.U().to_owned(), eigen.S().column_vector());
    let (centred, target_means) = centred_targets(targets.labels, targets.materials, &weights);
    let decomposed = Decomposed {
        values: (0..sweeps).map(|i| values[i]).collect(),
        projected: product(vectors.transpose(), centred.as_ref()),
        squares: Mat::from_fn(sweeps, sweeps, |i, j| vectors[(i, j)].powi(2)),
        vectors,
        weights,
    };
    Ok((decomposed, target_means))
}

fn solve(gram: Gram, targets: RidgeTargets<'_>) -> Result<Dual, ModelError> {
    let (decomposed, target_means) = decompose(gram, targets)?;
    let mut best: Option<(f64, f64, Mat<f64>)> = None;
    for &penalty in targets.penalties {
        let (dual, loss) = decomposed.fit(penalty);
        if best.as_ref().is_none_or(|(least, ..)| loss < *least) {
            best = Some((loss, penalty, dual));
        }
    }
    let (_, penalty, dual) = best.ok_or_else(|| ModelError::Fit {
        what: "ridge classifier",
        reason: "no penalty gives a finite leave-one-out residual".into(),
    })?;
    let roots: Vec<f64> = decomposed
        .weights
        .iter()
        .map(|weight| weight.sqrt())
        .collect();
    Ok(Dual {
        weights: Mat::from_fn(roots.len(), targets.materials, |i, j| {
            dual[(i, j)] * roots[i]
        }),
        target_means,
        penalty,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waves(sweeps: usize) -> (Vec<Vec<f32>>, Vec<usize>) {
        let row = |i: usize| {
            let wave = |k: usize| (0.7 * i as f64 * (k + 1) as f64 + k as f64).sin() as f32;
            (0..5).map(|k| wave(k) + 0.3 * (i % 3) as f32).collect()
        };
        (
            (0..sweeps).map(row).collect(),
            (0..sweeps).map(|i| i % 3).collect(),
        )
    }

    fn fit(rows: &[Vec<f32>], labels: &[usize], weights: Option<&[f64]>) -> Ridge {
        let features = Features::new(5, rows.concat());
        let targets = RidgeTargets {
            labels,
            materials: 3,
            weights,
            // One penalty: the leave-one-out residuals of repetitions are smaller, since a twin stays.
            penalties: &[0.5],
        };
        Ridge::fit(&features, Gram::of(&features), targets).unwrap()
    }

    #[test]
    fn whole_weights_are_repetitions_of_the_sweep() {
        let (rows, labels) = waves(12);
        let weights: Vec<f64> = (0..12).map(|i| (1 + i % 4) as f64).collect();
        let repeated: Vec<usize> = (0..12).flat_map(|i| vec![i; 1 + i % 4]).collect();
        let of = |i: &usize| rows[*i].clone();
        let rows_again: Vec<Vec<f32>> = repeated.iter().map(of).collect();
        let labels_again: Vec<usize> = repeated.iter().map(|i| labels[*i]).collect();
        let weighted = fit(&rows, &labels, Some(&weights));
        let expected = fit(&rows_again, &labels_again, None);
        for (found, expected) in weighted.coefficients.iter().zip(&expected.coefficients) {
            // Sums of single precision.
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        let plain = fit(&rows, &labels, None);
        assert!((plain.coefficients[0] - weighted.coefficients[0]).abs() > 1e-3);
        assert_eq!(fit(&rows, &labels, Some(&[1.0; 12])), plain);
    }

    /// The closed form is the residual of a fit without the sweep, with the same weights of the others.
    #[test]
    fn leave_one_out_residuals_are_those_of_fits_without_the_sweep() {
        let (rows, labels) = waves(9);
        let weights: Vec<f64> = (0..9).map(|i| 0.5 + 0.25 * (i % 4) as f64).collect();
        let features = Features::new(5, rows.concat());
        let gram = Gram::of(&features);
        let targets = RidgeTargets {
            labels: &labels,
            materials: 3,
            weights: Some(&weights),
            penalties: &[0.5],
        };
        let mut expected = 0.0;
        for sweep in 0..9 {
            let others: Vec<usize> = (0..9).filter(|other| *other != sweep).collect();
            let scores = gram.held_out_scores(&others, &[sweep], targets).unwrap();
            for (label, score) in scores[0].iter().enumerate() {
                let target = if labels[sweep] == label { 1.0 } else { -1.0 };
                expected += weights[sweep] * (score - target).powi(2);
            }
        }
        let (decomposed, _) = decompose(gram, targets).unwrap();
        let (_, found) = decomposed.fit(0.5);
        // Rounding of double precision, on features of single precision.
        assert!(
            (found - expected).abs() < 1e-4 * expected,
            "{found} {expected}"
        );
    }
}
