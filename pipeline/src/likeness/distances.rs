//! Distance of descriptions to the nearest material.

use tactnet_models::{Features, NearestMean, Whitening};

use super::directions::direction;
use crate::PipelineError;

/// Weight of the mean variance in the covariance within materials.
const SHRINKAGE: f64 = 0.3;
/// Minimum standard deviation within materials, as a share of that over all sweeps.
const LEAST_WITHIN: f64 = 1e-3;

/// Distance of a sweep from the training sweeps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Distance {
    /// Logarithm of the squared distance to the mean of the nearest material, whitened.
    pub log: f64,
    /// Label of that material.
    pub nearest: usize,
    /// Surprise about a taxel that does not change; 0 if there is none.
    pub stuck: f64,
}

/// Means and covariance of descriptions.
pub(super) struct Distances {
    /// Standard deviations within materials, `[width]`.
    scale: Vec<f32>,
    whitening: Whitening,
    means: NearestMean,
    /// Means before whitening, scaled, `[materials][width]`.
    centres: Vec<Vec<f32>>,
    /// Label of every mean.
    labels: Vec<usize>,
}

impl Distances {
    /// Fits to descriptions of sweeps with `labels`.
    ///
    /// # Errors
    /// A covariance without eigenvalues.
    pub fn fit(descriptions: &Features, labels: &[usize]) -> Result<Self, PipelineError> {
        let mut present = labels.to_vec();
        present.sort_unstable();
        present.dedup();
        let own: Vec<usize> = labels
            .iter()
            .map(|label| present.partition_point(|of| of < label))
            .collect();
        let scale = scale_of(descriptions, &own, present.len());
        let scaled = scaled(descriptions, &scale);
        let whitening = Whitening::fit(&scaled, &own, present.len(), SHRINKAGE)?;
        Ok(Self {
            means: NearestMean::fit(&whitening.apply(&scaled), &own, present.len()),
            centres: means_of(&scaled, &own, present.len()),
            whitening,
            scale,
            labels: present,
        })
    }

    /// Returns the distance of every description, without the taxels that do not change.
    pub fn of(&self, descriptions: &Features) -> Vec<Distance> {
        let rows = self.means.scores(&self.whitened(descriptions)).into_iter();
        rows.map(|row| {
            // Scores are minus half the squared distances. A value that is not finite is as far as possible.
            let far = |score: f64| {
                if score.is_finite() {
                    -2.0 * score
                } else {
                    f64::MAX
                }
            };
            let nearest = (0..row.len()).min_by(|a, b| far(row[*a]).total_cmp(&far(row[*b])));
            let nearest = nearest.unwrap_or(0);
            Distance {
                log: far(row[nearest]).max(f64::MIN_POSITIVE).ln(),
                nearest: self.labels[nearest],
                stuck: 0.0,
            }
        })
        .collect()
    }

    /// Returns descriptions after scaling and whitening.
    pub fn whitened(&self, descriptions: &Features) -> Features {
        self.whitening.apply(&scaled(descriptions, &self.scale))
    }

    /// Returns the directions in which descriptions differ from their nearest materials, `[sweeps][width]`.
    pub fn directions(&self, descriptions: &Features, distances: &[Distance]) -> Vec<Vec<f64>> {
        let whitened = self.whitened(descriptions);
        let rows = whitened.rows().zip(distances);
        rows.map(|(row, of)| direction(self.mean_of(of.nearest), row))
            .collect()
    }

    /// Returns the mean of a material after scaling and whitening.
    ///
    /// # Panics
    /// If no training sweep has the label.
    pub fn mean_of(&self, label: usize) -> &[f64] {
        &self.means()[self.labels.partition_point(|of| *of < label)]
    }

    /// Returns the difference of a description from the mean of a material, in standard deviations within materials.
    pub fn deviation(&self, description: &[f32], label: usize) -> Vec<f64> {
        let at = self.labels.partition_point(|of| *of < label);
        let centre = &self.centres[at];
        let values = description.iter().zip(&self.scale).zip(centre);
        values
            .map(|((value, scale), centre)| f64::from(value / scale) - f64::from(*centre))
            .collect()
    }

    /// Returns the whitening of descriptions.
    pub fn whitening(&self) -> &Whitening {
        &self.whitening
    }

    /// Returns the means of the materials after scaling and whitening, `[materials][width]`.
    pub fn means(&self) -> &[Vec<f64>] {
        self.means.means()
    }

    /// Returns the label of every mean.
    pub fn labels(&self) -> &[usize] {
        &self.labels
    }

    /// Returns the standard deviations within materials, `[width]`.
    pub fn scale(&self) -> &[f32] {
        &self.scale
    }
}

/// Returns the mean of every class, `[classes][width]`.
fn means_of(descriptions: &Features, labels: &[usize], classes: usize) -> Vec<Vec<f32>> {
    let width = descriptions.width();
    let mut sums = vec![vec![0.0f64; width]; classes];
    let mut counts = vec![0.0f64; classes];
    for (row, label) in descriptions.rows().zip(labels) {
        counts[*label] += 1.0;
        for (sum, value) in sums[*label].iter_mut().zip(row) {
            *sum += f64::from(*value);
        }
    }
    sums.into_iter()
        .zip(counts)
        .map(|(sum, count)| sum.into_iter().map(|sum| (sum / count) as f32).collect())
        .collect()
}

/// Returns the standard deviations within classes, `[width]`.
fn scale_of(descriptions: &Features, labels: &[usize], classes: usize) -> Vec<f32> {
    let width = descriptions.width();
    let sweeps = descriptions.len() as f64;
    let means = means_of(descriptions, labels, classes);
    let whole = means_of(descriptions, &vec![0; labels.len()], 1);
    let degrees = (descriptions.len().saturating_sub(classes)).max(1) as f64;
    let mut squares = vec![[0.0f64; 2]; width];
    for (row, label) in descriptions.rows().zip(labels) {
        for (at, value) in row.iter().enumerate() {
            squares[at][0] += f64::from(value - means[*label][at]).powi(2);
            squares[at][1] += f64::from(value - whole[0][at]).powi(2);
        }
    }
    squares
        .into_iter()
        .map(|[within, all]| {
            let least = LEAST_WITHIN * (all / sweeps).sqrt() + 1e-12;
            (within / degrees).sqrt().max(least) as f32
        })
        .collect()
}

fn scaled(descriptions: &Features, scale: &[f32]) -> Features {
    let rows = descriptions.rows();
    let values = rows.flat_map(|row| row.iter().zip(scale).map(|(value, scale)| value / scale));
    Features::new(descriptions.width(), values.collect())
}
