//! Scaling of feature vectors, fitted to training sweeps.

use tactnet_models::{Features, Weights};

use crate::PipelineError;
use crate::Shift;
use crate::adapt::shift::{Moment, believed};
use crate::features::arrays::{get, of_length, put};

/// Scaler that subtracts a mean from every feature and multiplies by a gain.
///
/// The last `sparse` features are Hydra's: their square roots are scaled, and zeros stay zero (aeon's `_SparseScaler`).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Scaler {
    /// `[width]`
    mean: Vec<f32>,
    /// `[width]`
    gain: Vec<f32>,
    sparse: usize,
}

impl Scaler {
    /// Fits means and standard deviations to `train`. A constant feature has a gain of one.
    pub fn fit(train: &Features, sparse: usize) -> Self {
        let width = train.width();
        let dense = width - sparse;
        let sweeps = train.len() as f64;
        let mut mean = vec![0.0_f64; width];
        let mut zeros = vec![0.0_f64; width];
        for row in train.rows() {
            for (index, value) in row.iter().enumerate() {
                let value = rooted(*value, index >= dense);
                mean[index] += f64::from(value);
                zeros[index] += f64::from(u8::from(value == 0.0));
            }
        }
        mean.iter_mut().for_each(|mean| *mean /= sweeps);
        let mut squares = vec![0.0_f64; width];
        for row in train.rows() {
            for (index, value) in row.iter().enumerate() {
                let value = f64::from(rooted(*value, index >= dense));
                squares[index] += (value - mean[index]).powi(2);
            }
        }
        let gain = squares
            .iter()
            .enumerate()
            .map(|(index, squares)| {
                if index < dense {
                    let deviation = (squares / sweeps).sqrt();
                    if deviation > 0.0 {
                        (1.0 / deviation) as f32
                    } else {
                        1.0
                    }
                } else {
                    // Damps kernels that rarely win; the constants are the paper's.
                    let deviation = (squares / (sweeps - 1.0).max(1.0)).sqrt();
                    let rare = (zeros[index] / sweeps).powi(4) + 1e-8;
                    (1.0 / (deviation + rare)) as f32
                }
            })
            .collect();
        Self {
            mean: mean.iter().map(|mean| *mean as f32).collect(),
            gain,
            sparse,
        }
    }

    /// Scales features in place.
    ///
    /// # Panics
    /// If `features` have another width.
    pub fn apply(&self, features: &mut Features) {
        let width = features.width();
        assert_eq!(width, self.mean.len(), "width of a row");
        let dense = width - self.sparse;
        for row in features.values_mut().chunks_exact_mut(width) {
            let scales = self.mean.iter().zip(&self.gain);
            for (index, (value, (mean, gain))) in row.iter_mut().zip(scales).enumerate() {
                let sparse = index >= dense;
                let rooted = rooted(*value, sparse);
                *value = if sparse && rooted == 0.0 {
                    0.0
                } else {
                    (rooted - mean) * gain
                };
            }
        }
    }

    /// Returns the scaler of sweeps with these features, which are not scaled: means and standard deviations change as far as they differ from
    /// those of the training sweeps beyond chance.
    pub fn adapted(&self, features: &Features) -> (Self, Shift) {
        let dense = features.width() - self.sparse;
        let known: Vec<Moment> = self
            .mean
            .iter()
            .zip(&self.gain)
            .map(|(mean, gain)| Moment {
                mean: f64::from(*mean),
                variance: f64::from(*gain).powi(-2),
            })
            .collect();
        let sweeps: Vec<Vec<Moment>> = features
            .rows()
            .map(|row| {
                let values = row.iter().enumerate();
                let rooted = values.map(|(index, value)| rooted(*value, index >= dense));
                rooted.map(Moment::of_value).collect()
            })
            .collect();
        let (moments, shift) = believed(&known, &sweeps);
        let adapted = Self {
            mean: moments.iter().map(|of| of.mean as f32).collect(),
            gain: moments
                .iter()
                .map(|of| of.variance.powf(-0.5) as f32)
                .collect(),
            sparse: self.sparse,
        };
        (adapted, shift)
    }

    /// Writes means and gains into `weights`.
    pub fn save(&self, weights: &mut Weights) {
        put(weights, "scaler.mean", self.mean.clone());
        put(weights, "scaler.gain", self.gain.clone());
    }

    /// Restores the scaler written by [`Scaler::save`].
    ///
    /// - `width`: number of features
    ///
    /// # Errors
    /// Tensors that are missing or of another length.
    pub fn load(weights: &Weights, width: usize, sparse: usize) -> Result<Self, PipelineError> {
        let of_width = |name: &str| {
            let values = get(weights, name)?.values.clone();
            of_length(name, values.len(), width)?;
            Ok::<_, PipelineError>(values)
        };
        Ok(Self {
            mean: of_width("scaler.mean")?,
            gain: of_width("scaler.gain")?,
            sparse,
        })
    }
}

fn rooted(value: f32, sparse: bool) -> f32 {
    if sparse { value.max(0.0).sqrt() } else { value }
}
