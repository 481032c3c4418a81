//! Directions in which sweeps differ from the mean of their nearest material.
//!
//! Sweeps of the training data's kind differ in all directions. Another skin moves all sweeps in one direction, which a few sweeps
//! show even if each is within the usual distance.

use tactnet_models::Features;

use super::distances::Distances;

/// Returns the direction from one point to another as a vector of length 1; zeros if there is none.
pub(super) fn direction(from: &[f64], to: &[f32]) -> Vec<f64> {
    let mut difference: Vec<f64> = to
        .iter()
        .zip(from)
        .map(|(to, from)| f64::from(*to) - from)
        .collect();
    let length = difference
        .iter()
        .map(|value| value * value)
        .sum::<f64>()
        .sqrt();
    let scale = if length.is_finite() && length > 0.0 {
        1.0 / length
    } else {
        0.0
    };
    for value in &mut difference {
        *value = if scale > 0.0 { *value * scale } else { 0.0 };
    }
    difference
}

/// Whitened training sweeps, for the directions of those that are held out in turn.
pub(super) struct KnownDirections<'a> {
    distances: &'a Distances,
    whitened: Features,
    labels: &'a [usize],
}

impl<'a> KnownDirections<'a> {
    /// - `descriptions`, `labels`: training sweeps that `distances` was fitted to
    pub fn new(distances: &'a Distances, descriptions: &Features, labels: &'a [usize]) -> Self {
        let whitened = distances.whitened(descriptions);
        Self {
            distances,
            whitened,
            labels,
        }
    }

    /// Returns the direction of a training sweep from the mean of the other sweeps of a material.
    ///
    /// - `nearest`: label of the material
    pub fn of(&self, sweep: usize, nearest: usize) -> Vec<f64> {
        let mut mean = self.distances.mean_of(nearest).to_vec();
        let row = self.whitened.row(sweep);
        if self.labels[sweep] == nearest {
            let all = self
                .labels
                .iter()
                .filter(|label| **label == nearest)
                .count() as f64;
            for (mean, own) in mean.iter_mut().zip(row) {
                *mean = (*mean * all - f64::from(*own)) / (all - 1.0);
            }
        }
        direction(&mean, row)
    }
}
