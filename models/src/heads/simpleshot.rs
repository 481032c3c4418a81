//! Nearest class mean on unit vectors.

use super::{class_means, squared_distance};
use crate::Features;

/// Nearest class mean after subtracting the knowledge set's mean and scaling to unit length (SimpleShot, CL2N; Wang et al., 2019).
#[derive(Debug, Clone, PartialEq)]
pub struct SimpleShot {
    /// `[width]`, mean feature of the knowledge set.
    centre: Vec<f64>,
    /// `[materials][width]`, means of centred, normalised features.
    means: Vec<Vec<f64>>,
}

impl SimpleShot {
    /// Computes the means of the task's classes.
    ///
    /// # Panics
    /// If a class has no sweep.
    pub fn fit(features: &Features, labels: &[usize], materials: usize, centre: Vec<f64>) -> Self {
        let rows: Vec<Vec<f64>> = features
            .rows()
            .map(|row| centred_unit(row, &centre))
            .collect();
        Self {
            means: class_means(&rows, labels, materials),
            centre,
        }
    }

    /// Returns minus the squared distance to every class mean, `[sweeps][materials]`.
    pub fn scores(&self, features: &Features) -> Vec<Vec<f64>> {
        features
            .rows()
            .map(|row| {
                let row = centred_unit(row, &self.centre);
                self.means
                    .iter()
                    .map(|mean| -squared_distance(&row, mean))
                    .collect()
            })
            .collect()
    }
}

fn centred_unit(row: &[f32], centre: &[f64]) -> Vec<f64> {
    let centred: Vec<f64> = row
        .iter()
        .zip(centre)
        .map(|(v, c)| f64::from(*v) - c)
        .collect();
    let norm = centred.iter().map(|v| v * v).sum::<f64>().sqrt();
    if norm == 0.0 {
        return centred;
    }
    centred.iter().map(|v| v / norm).collect()
}
