//! Subspace that a few sweeps span.

use faer::{Mat, Par};

use crate::Features;

/// Sweeps in an orthonormal basis of their span, if they are fewer than the features.
///
/// The loss depends only on the weights' component in this span, and the penalty is smallest if the other component equals the prior's
/// mean. So a few sweeps give a small optimisation problem.
pub(super) struct Span {
    /// `[sweeps][dimension]`
    pub(super) coordinates: Vec<Vec<f64>>,
    /// `[width + 1, dimension]`; `None` if there are at least as many sweeps as values.
    basis: Option<Mat<f64>>,
}

impl Span {
    /// - `constant`: value appended to every sweep's features as the input of the bias
    pub(super) fn of(features: &Features, constant: f64) -> Self {
        let (sweeps, width) = (features.len(), features.width() + 1);
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| {
                row.iter()
                    .map(|v| f64::from(*v))
                    .chain([constant])
                    .collect()
            })
            .collect();
        if sweeps >= width {
            return Self {
                coordinates: rows,
                basis: None,
            };
        }
        // With several threads, faer's sums depend on their number.
        faer::set_global_parallelism(Par::Seq);
        let columns = Mat::<f64>::from_fn(width, sweeps, |i, j| rows[j][i]);
        let qr = columns.qr();
        let triangle = qr.thin_R();
        Self {
            coordinates: (0..sweeps)
                .map(|sweep| {
                    (0..sweeps)
                        .map(|i| {
                            if i <= sweep {
                                triangle[(i, sweep)]
                            } else {
                                0.0
                            }
                        })
                        .collect()
                })
                .collect(),
            basis: Some(qr.compute_thin_Q()),
        }
    }

    pub(super) fn dimension(&self) -> usize {
        self.coordinates.first().map_or(0, Vec::len)
    }

    /// Returns the coordinates of a vector's projection onto the span.
    pub(super) fn project(&self, vector: &[f64]) -> Vec<f64> {
        match &self.basis {
            None => vector.to_vec(),
            Some(basis) => (0..basis.ncols())
                .map(|j| {
                    vector
                        .iter()
                        .enumerate()
                        .map(|(i, v)| basis[(i, j)] * v)
                        .sum()
                })
                .collect(),
        }
    }

    /// Returns the vector with these coordinates in the span and the component of `outside` orthogonal to it.
    ///
    /// - `projected`: coordinates of `outside`
    pub(super) fn lift(&self, coordinates: &[f64], projected: &[f64], outside: &[f64]) -> Vec<f64> {
        match &self.basis {
            None => coordinates.to_vec(),
            Some(basis) => outside
                .iter()
                .enumerate()
                .map(|(i, out)| {
                    let inside = coordinates.iter().zip(projected).enumerate();
                    out + inside
                        .map(|(j, (c, p))| basis[(i, j)] * (c - p))
                        .sum::<f64>()
                })
                .collect(),
        }
    }
}
