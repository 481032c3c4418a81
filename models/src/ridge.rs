//! Ridge classifier on random-convolution features, with a penalty chosen by closed-form leave-one-out cross-validation.
//!
//! Each material has one target column: +1 for the material, else -1 (Dempster et al., 2020; scikit-learn's `RidgeClassifierCV`).
//! There are more features than sweeps, so the fit uses the Gram matrix `K = X X^T = Q diag(w) Q^T` of the centred features.
//! The dual weights are `c = Q diag(1/(w + penalty)) Q^T y`. The leave-one-out residual of sweep `i` is `c_i / G_ii` with
//! `G = (K + penalty)^-1` (Rifkin & Lippert, 2007). The intercept is not penalised: targets are centred, and the vector of ones, an
//! eigenvector of `K` with eigenvalue 0, is removed from `G`.

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
    /// - `labels`: labels of all sweeps
    ///
    /// # Errors
    /// The eigenvalue decomposition fails; no penalty gives a finite residual.
    pub fn held_out_scores(
        &self,
        train: &[usize],
        held: &[usize],
        labels: &[usize],
        materials: usize,
        penalties: &[f64],
    ) -> Result<Vec<Vec<f64>>, ModelError> {
        let truth: Vec<usize> = train.iter().map(|&position| labels[position]).collect();
        let dual = solve(self.select(train), &truth, materials, penalties)?;
        // W = X^T c with weights c that sum to zero, so (x - mean) W = sum over i of c_i (K_xi - mean over j of K_ji).
        let means: Vec<f64> = train
            .iter()
            .map(|&i| train.iter().map(|&j| self.0[(j, i)]).sum::<f64>() / train.len() as f64)
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

    /// Returns the Gram matrix of the centred features.
    fn centred(mut self) -> Mat<f64> {
        let sweeps = self.0.nrows();
        let means: Vec<f64> = (0..sweeps)
            .map(|column| self.0.col_as_slice(column).iter().sum::<f64>() / sweeps as f64)
            .collect();
        let mean = means.iter().sum::<f64>() / sweeps as f64;
        for column in 0..sweeps {
            let shift = mean - means[column];
            for (value, row) in self.0.col_as_slice_mut(column).iter_mut().zip(&means) {
                *value += shift - row;
            }
        }
        self.0
    }
}

/// Dual weights of a fit and the penalty that gave them.
struct Dual {
    /// `[sweeps][materials]`
    weights: Mat<f64>,
    /// `[materials]`
    target_means: Vec<f64>,
    penalty: f64,
}

impl Ridge {
    /// Fits to `features` and their Gram matrix with the penalty that has the smallest mean squared leave-one-out residual.
    ///
    /// - `labels`: `[sweeps]`, below `materials`
    ///
    /// # Errors
    /// The eigenvalue decomposition fails; no penalty gives a finite residual.
    pub fn fit(
        features: &Features,
        gram: Gram,
        labels: &[usize],
        materials: usize,
        penalties: &[f64],
    ) -> Result<Self, ModelError> {
        let dual = solve(gram, labels, materials, penalties)?;
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
        for row in features.rows() {
            means
                .iter_mut()
                .zip(row)
                .for_each(|(m, v)| *m += f64::from(*v));
        }
        means.iter_mut().for_each(|m| *m /= sweeps as f64);
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

/// Returns `[sweeps][materials]` targets, 1 for the sweep's material and -1 for others, minus their means; and the means.
fn centred_targets(labels: &[usize], materials: usize) -> (Mat<f64>, Vec<f64>) {
    let sweeps = labels.len();
    let mut targets = Mat::<f64>::from_fn(sweeps, materials, |sweep, label| {
        if labels[sweep] == label { 1.0 } else { -1.0 }
    });
    let mut target_means = Vec::with_capacity(materials);
    for label in 0..materials {
        let column = targets.col_as_slice_mut(label);
        let mean = column.iter().sum::<f64>() / sweeps as f64;
        column.iter_mut().for_each(|target| *target -= mean);
        target_means.push(mean);
    }
    (targets, target_means)
}

fn solve(
    gram: Gram,
    labels: &[usize],
    materials: usize,
    penalties: &[f64],
) -> Result<Dual, ModelError> {
    let sweeps = labels.len();
    let gram = gram.centred();
    // faer's tridiagonalisation adds one partial sum per thread. With one thread, results do not depend on the number of threads.
    faer::set_global_parallelism(Par::Seq);
    let eigen = gram
        .self_adjoint_eigen(Side::Lower)
        .map_err(|error| ModelError::Fit {
            what: "ridge classifier",
            reason: format!("no eigenvalues of the Gram matrix: {error:?}"),
        })?;
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    let (targets, target_means) = centred_targets(labels, materials);
    let projected = product(vectors.transpose(), targets.as_ref());
    let squares = Mat::<f64>::from_fn(sweeps, sweeps, |i, j| vectors[(i, j)].powi(2));
    let mut best: Option<(f64, Dual)> = None;
    for &penalty in penalties {
        // Eigenvalues of a Gram matrix are not negative, except by rounding.
        let inverse: Vec<f64> = (0..sweeps)
            .map(|i| 1.0 / (values[i].max(0.0) + penalty))
            .collect();
        let scaled = Mat::<f64>::from_fn(sweeps, materials, |i, j| projected[(i, j)] * inverse[i]);
        let weights = product(vectors, scaled.as_ref());
        let of_ones = 1.0 / (penalty * sweeps as f64);
        let mut loss = 0.0;
        let inverse = Mat::<f64>::from_fn(sweeps, 1, |i, _| inverse[i]);
        let diagonal = product(squares.as_ref(), inverse.as_ref());
        for sweep in 0..sweeps {
            let diagonal = diagonal[(sweep, 0)] - of_ones;
            loss += (0..materials)
                .map(|label| (weights[(sweep, label)] / diagonal).powi(2))
                .sum::<f64>();
        }
        if best.as_ref().is_none_or(|(least, _)| loss < *least) {
            let target_means = target_means.clone();
            best = Some((
                loss,
                Dual {
                    weights,
                    target_means,
                    penalty,
                },
            ));
        }
    }
    best.map(|(_, dual)| dual).ok_or_else(|| ModelError::Fit {
        what: "ridge classifier",
        reason: "no penalty gives a finite leave-one-out residual".into(),
    })
}
