//! Whitening with the within-class covariance.

use faer::{Mat, Par, Side};

use super::class_means;
use crate::{Features, ModelError};

/// Linear map that makes the knowledge set's within-class covariance the identity, after shrinkage towards its mean variance.
#[derive(Debug, Clone)]
pub struct Whitening {
    /// `[width]`
    centre: Vec<f64>,
    /// `[width][width]`
    map: Mat<f64>,
}

impl Whitening {
    /// Fits to the knowledge set.
    ///
    /// - `shrinkage`: weight of the mean variance, 0 to 1; above 0 if there are fewer sweeps than features
    ///
    /// # Errors
    /// The eigenvalue decomposition of the covariance fails.
    pub fn fit(
        features: &Features,
        labels: &[usize],
        materials: usize,
        shrinkage: f64,
    ) -> Result<Self, ModelError> {
        let width = features.width();
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| row.iter().map(|v| f64::from(*v)).collect())
            .collect();
        let means = class_means(&rows, labels, materials);
        faer::set_global_parallelism(Par::Seq);
        let residuals =
            Mat::<f64>::from_fn(rows.len(), width, |i, j| rows[i][j] - means[labels[i]][j]);
        let degrees = rows.len().saturating_sub(materials).max(1) as f64;
        let mut covariance = residuals.transpose() * &residuals;
        let mean_variance =
            (0..width).map(|i| covariance[(i, i)]).sum::<f64>() / degrees / width as f64;
        for i in 0..width {
            for j in 0..width {
                covariance[(i, j)] *= (1.0 - shrinkage) / degrees;
            }
            covariance[(i, i)] += shrinkage * mean_variance;
        }
        let eigen = covariance
            .self_adjoint_eigen(Side::Lower)
            .map_err(|error| ModelError::Fit {
                what: "whitening",
                reason: format!("no eigenvalues of the covariance: {error:?}"),
            })?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let floor = 1e-9 * mean_variance.max(f64::MIN_POSITIVE);
        let scaled = Mat::<f64>::from_fn(width, width, |i, j| {
            vectors[(i, j)] / values[j].max(floor).sqrt()
        });
        let centre = (0..width)
            .map(|i| rows.iter().map(|row| row[i]).sum::<f64>() / rows.len() as f64)
            .collect();
        Ok(Self {
            centre,
            map: vectors * scaled.transpose(),
        })
    }

    /// Returns the mean of all features, which is mapped to zero: `[width]`.
    pub fn centre(&self) -> &[f64] {
        &self.centre
    }

    /// Returns the weight of feature `from` in the whitened feature `to`.
    pub fn weight(&self, from: usize, to: usize) -> f64 {
        self.map[(from, to)]
    }

    /// Returns the whitened features, `[sweeps][width]`.
    pub fn apply(&self, features: &Features) -> Features {
        faer::set_global_parallelism(Par::Seq);
        let width = features.width();
        let centred = Mat::<f64>::from_fn(features.len(), width, |i, j| {
            f64::from(features.row(i)[j]) - self.centre[j]
        });
        let mapped = centred * &self.map;
        let values = (0..features.len())
            .flat_map(|i| (0..width).map(move |j| (i, j)))
            .map(|(i, j)| mapped[(i, j)] as f32)
            .collect();
        Features::new(width, values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two classes with two sweeps each: residuals of 2 on one axis and two degrees of freedom give variances of 8 and 0, with mean 4.
    /// Shrinkage by one half gives 4 + 2 and 0 + 2.
    #[test]
    fn the_covariance_is_shrunk_towards_the_mean_variance() {
        let features = Features::new(2, vec![-2.0, 1.0, 2.0, 1.0, 8.0, 5.0, 12.0, 5.0]);
        let whitening = Whitening::fit(&features, &[0, 0, 1, 1], 2, 0.5).unwrap();
        let lengths: Vec<f64> = [[1.0_f32, 0.0], [0.0, 1.0]]
            .iter()
            .map(|step| {
                let at = |x: [f32; 2]| whitening.apply(&Features::new(2, x.to_vec()));
                let (from, to) = (at([0.0, 0.0]), at(*step));
                let squares = from.values().iter().zip(to.values());
                squares.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>()
            })
            .collect();
        for (found, expected) in lengths.iter().zip([1.0 / 6.0, 1.0 / 2.0]) {
            assert!((found - expected).abs() < 1e-6, "{lengths:?}");
        }
    }
}
