//! Linear discriminant analysis, a linear baseline on features.
//!
//! Materials are normal classes with one covariance, shrunk towards its diagonal by the estimate of Ledoit and Wolf (J. Multivariate
//! Analysis 88, 2004), as in scikit-learn's `LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")`.

use faer::linalg::solvers::Solve;
use faer::{Mat, Par, Side};

use crate::{Features, ModelError, log_softmax};

/// Fitted linear discriminant.
#[derive(Debug, Clone, PartialEq)]
pub struct Lda {
    /// `[materials][width]`
    pub coefficients: Vec<f64>,
    /// `[materials]`
    pub intercepts: Vec<f64>,
}

impl Lda {
    /// Fits to `features` with `labels` below `materials`; prior probabilities are the label frequencies.
    ///
    /// - `weights`: `[sweeps]`, positive; `None`: all are equal. Frequencies, means and covariances are weighted sums. The shrinkage follows
    ///   the effective number of sweeps, `(sum w)^2 / sum w^2` (Kish, 1965).
    ///
    /// # Errors
    /// The covariance is not positive definite.
    pub fn fit(
        features: &Features,
        labels: &[usize],
        materials: usize,
        weights: Option<&[f64]>,
    ) -> Result<Self, ModelError> {
        // With one thread, results do not depend on the number of threads.
        faer::set_global_parallelism(Par::Seq);
        let weight = |sweep: usize| weights.map_or(1.0, |weights| weights[sweep]);
        let (width, total) = (features.width(), (0..labels.len()).map(weight).sum::<f64>());
        let mut covariance = Mat::<f64>::zeros(width, width);
        let mut means = Mat::<f64>::zeros(width, materials);
        let mut logs = vec![f64::NEG_INFINITY; materials];
        for label in 0..materials {
            let rows: Vec<WeightedRow<'_>> = features
                .values()
                .chunks_exact(width)
                .zip(labels)
                .enumerate()
                .filter(|(_, (_, found))| **found == label)
                .map(|(sweep, (values, _))| WeightedRow {
                    values,
                    weight: weight(sweep),
                })
                .collect();
            if rows.is_empty() {
                continue;
            }
            let prior = rows.iter().map(|row| row.weight).sum::<f64>() / total;
            logs[label] = prior.ln();
            let (mean, shrunk) = mean_and_covariance(&rows, width);
            covariance += faer::Scale(prior) * shrunk;
            (0..width).for_each(|k| means[(k, label)] = mean[k]);
        }
        let solver = covariance.llt(Side::Lower).map_err(|_| ModelError::Fit {
            what: "linear discriminant analysis",
            reason: "the covariance is not positive definite".into(),
        })?;
        let directions = solver.solve(&means);
        let intercepts = (0..materials).map(|label| {
            let half: f64 = (0..width)
                .map(|k| directions[(k, label)] * means[(k, label)])
                .sum();
            logs[label] - half / 2.0
        });
        Ok(Self {
            intercepts: intercepts.collect(),
            coefficients: (0..materials)
                .flat_map(|label| (0..width).map(move |k| (k, label)))
                .map(|at| directions[at])
                .collect(),
        })
    }

    /// Returns log-probabilities `[sweeps][materials]`.
    pub fn log_probabilities(&self, features: &Features) -> Vec<Vec<f64>> {
        let width = features.width();
        let rows = features.values().chunks_exact(width);
        rows.map(|row| {
            let each = self.coefficients.chunks_exact(width).zip(&self.intercepts);
            let scores: Vec<f32> = each
                .map(|(direction, intercept)| {
                    let products = direction.iter().zip(row).map(|(d, x)| d * f64::from(*x));
                    (products.sum::<f64>() + intercept) as f32
                })
                .collect();
            log_softmax(&scores)
        })
        .collect()
    }
}

/// Features of a sweep with its weight.
struct WeightedRow<'a> {
    values: &'a [f32],
    weight: f64,
}

/// Returns mean and shrunk covariance of one class; the shrinkage is estimated on features scaled to unit variance.
fn mean_and_covariance(rows: &[WeightedRow<'_>], width: usize) -> (Vec<f64>, Mat<f64>) {
    let n: f64 = rows.iter().map(|row| row.weight).sum();
    let squares: f64 = rows.iter().map(|row| row.weight.powi(2)).sum();
    let mut mean = vec![0.0; width];
    for row in rows {
        for (mean, x) in mean.iter_mut().zip(row.values) {
            *mean += row.weight * f64::from(*x) / n;
        }
    }
    let mut scale = vec![0.0; width];
    for row in rows {
        for ((scale, x), mean) in scale.iter_mut().zip(row.values).zip(&mean) {
            *scale += row.weight * (f64::from(*x) - mean).powi(2) / n;
        }
    }
    for scale in &mut scale {
        *scale = if *scale > 0.0 { scale.sqrt() } else { 1.0 };
    }
    // Rows times the roots of their weights, so that products of columns are weighted sums.
    let centred = Mat::from_fn(rows.len(), width, |row, k| {
        let WeightedRow { values, weight } = &rows[row];
        weight.sqrt() * ((f64::from(values[k]) - mean[k]) / scale[k])
    });
    let mut covariance = centred.transpose() * &centred * faer::Scale(1.0 / n);
    let trace = (0..width).map(|k| covariance[(k, k)]).sum::<f64>() / width as f64;
    // The norm of a row of `centred` has the factor sqrt(w), so its fourth power has w^2.
    let fourth: f64 = (0..centred.nrows())
        .map(|row| {
            let norm = centred.row(row).iter().map(|x| x * x).sum::<f64>();
            norm.powi(2) / rows[row].weight
        })
        .sum();
    let shrinkage = shrinkage(Moments {
        fourth: fourth / n,
        effective: n.powi(2) / squares,
        trace,
        covariance: &covariance,
    });
    for i in 0..width {
        for j in 0..width {
            covariance[(i, j)] *= 1.0 - shrinkage;
        }
        covariance[(i, i)] += shrinkage * trace;
    }
    for i in 0..width {
        for j in 0..width {
            covariance[(i, j)] *= scale[i] * scale[j];
        }
    }
    (mean, covariance)
}

/// Moments of the scaled features of a class.
struct Moments<'a> {
    /// Mean fourth power of the norm of a sweep.
    fourth: f64,
    /// Effective number of sweeps.
    effective: f64,
    /// Mean of the covariance's diagonal.
    trace: f64,
    covariance: &'a Mat<f64>,
}

/// Returns Ledoit and Wolf's estimate of the shrinkage, 0 to 1.
fn shrinkage(moments: Moments<'_>) -> f64 {
    let width = moments.covariance.ncols() as f64;
    let squares: f64 = moments.covariance.squared_norm_l2();
    // Sum over all feature pairs of the variance of their products, over the squared distance to a multiple of the unit matrix.
    let beta = (moments.fourth - squares) / (width * moments.effective);
    let delta = squares / width - moments.trace * moments.trace;
    if delta <= 0.0 || beta <= 0.0 {
        return if beta <= 0.0 { 0.0 } else { 1.0 };
    }
    (beta / delta).min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Expected values: scikit-learn 1.9.1, `LinearDiscriminantAnalysis(solver="lsqr", shrinkage="auto")` on the same numbers.
    #[test]
    fn discriminants_are_those_of_scikit_learn() {
        // x = sin(0.7 i (k + 1) + k) + 0.3 label, in single precision.
        let (sweeps, width, materials) = (12, 3, 3);
        let labels: Vec<usize> = (0..sweeps).map(|i| i % materials).collect();
        let values = (0..sweeps)
            .flat_map(|i| (0..width).map(move |k| (i, k)))
            .map(|(i, k)| {
                let wave = (0.7 * i as f64 * (k + 1) as f64 + k as f64).sin();
                (wave + 0.3 * labels[i] as f64) as f32
            })
            .collect();
        let features = Features::new(width, values);
        let lda = Lda::fit(&features, &labels, materials, None).unwrap();
        let expected = GOLDEN;
        for (found, expected) in lda.coefficients.iter().zip(expected.0) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        for (found, expected) in lda.intercepts.iter().zip(expected.1) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        let first = lda.log_probabilities(&features)[0].clone();
        assert!((first.iter().map(|l| l.exp()).sum::<f64>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_material_without_sweeps_is_never_predicted() {
        let features = Features::new(1, vec![0.0, 1.0, 5.0, 6.0]);
        let lda = Lda::fit(&features, &[0, 0, 2, 2], 3, None).unwrap();
        for row in lda.log_probabilities(&features) {
            assert_eq!(row[1], f64::NEG_INFINITY);
        }
    }

    /// Of a single feature the shrinkage, which counts repetitions as one sweep, has no influence.
    #[test]
    fn whole_weights_are_repetitions_of_the_sweep() {
        let features = Features::new(1, vec![0.0, 1.0, 3.0, 5.0, 6.0]);
        let labels = [0, 0, 0, 1, 1];
        let plain = Lda::fit(&features, &labels, 2, None).unwrap();
        let doubled = Lda::fit(&features, &labels, 2, Some(&[2.0; 5])).unwrap();
        let weighted = Lda::fit(&features, &labels, 2, Some(&[1.0, 1.0, 2.0, 1.0, 3.0])).unwrap();
        let repeated = Features::new(1, vec![0.0, 1.0, 3.0, 3.0, 5.0, 6.0, 6.0, 6.0]);
        let repeated = Lda::fit(&repeated, &[0, 0, 0, 0, 1, 1, 1, 1], 2, None).unwrap();
        let numbers = |lda: &Lda| [lda.coefficients.clone(), lda.intercepts.clone()].concat();
        for (found, expected, how) in [
            (&doubled, &plain, "doubled"),
            (&weighted, &repeated, "repeated"),
        ] {
            for (found, expected) in numbers(found).iter().zip(numbers(expected)) {
                // Rounding of double precision.
                assert!(
                    (found - expected).abs() < 1e-9 * expected.abs().max(1.0),
                    "{how}: {found} {expected}"
                );
            }
        }
        assert_ne!(numbers(&weighted), numbers(&plain));
    }

    const GOLDEN: ([f64; 9], [f64; 3]) = (
        [
            -0.6320984033342097,
            -0.20420774723339719,
            5097.573430916195,
            1.3351177749498238,
            1.331501693574642,
            -3021.5777070166855,
            1.4280397333054118,
            0.48417378362172947,
            3075.1311153122797,
        ],
        [-2290.790431902839, -806.0102556700593, -835.2944671836099],
    );
}
