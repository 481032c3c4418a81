//! Nearest class mean on whitened features.

use super::{class_means, squared_distance};
use crate::Features;

/// Nearest class mean; on features whitened with the knowledge set's covariance it is linear discriminant analysis.
#[derive(Debug, Clone, PartialEq)]
pub struct NearestMean {
    /// `[materials][width]`
    means: Vec<Vec<f64>>,
}

impl NearestMean {
    /// Computes the means of the task's classes.
    ///
    /// # Panics
    /// If a class has no sweep.
    pub fn fit(features: &Features, labels: &[usize], materials: usize) -> Self {
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| row.iter().map(|v| f64::from(*v)).collect())
            .collect();
        Self {
            means: class_means(&rows, labels, materials),
        }
    }

    /// Returns the class means, `[materials][width]`.
    pub fn means(&self) -> &[Vec<f64>] {
        &self.means
    }

    /// Returns minus half the squared distance to every class mean, `[sweeps][materials]`: log-likelihoods up to a constant on whitened features.
    pub fn scores(&self, features: &Features) -> Vec<Vec<f64>> {
        features
            .rows()
            .map(|row| {
                let row: Vec<f64> = row.iter().map(|v| f64::from(*v)).collect();
                self.means
                    .iter()
                    .map(|mean| -0.5 * squared_distance(&row, mean))
                    .collect()
            })
            .collect()
    }
}
