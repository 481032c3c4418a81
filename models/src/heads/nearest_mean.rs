//! Nearest class mean.

use super::{class_means, squared_distance};
use crate::Features;

/// Linear discriminant analysis with the knowledge set's within-class covariance: the nearest class mean among whitened features.
#[derive(Debug, Clone, PartialEq)]
pub struct NearestMean {
    /// `[materials][width]`
    means: Vec<Vec<f64>>,
}

impl NearestMean {
    /// Means of the task's classes.
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

    /// Minus half the squared distance to every class mean: log-likelihoods up to a constant where features are whitened.
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
