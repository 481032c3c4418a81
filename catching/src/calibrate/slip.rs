//! Detects an invalid calibration. Tendons slip and stretch (thesis, section 3.3.2), so a joint's zero jumps and
//! features deviate from their expected positions.
//!
//! An innovation is a feature (or a ball's circle) minus its prediction, with the covariance of calibration and noise.
//! Its normalised square follows a chi-square distribution with 2 degrees of freedom. Squares are limited to `clip`, so
//! that a few outliers cause no alarm. Calibration errors persist from picture to picture, so the squares are not
//! independent and their mean over a window may exceed 2. The alarm limit is therefore a multiple of 2.

use std::collections::VecDeque;

use nalgebra::{DMatrix, Matrix2, SMatrix, Vector2};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::checks::positive;

use super::error::CalibrationError;
use super::model::Model;
use super::problem::Noise;
use super::session::Picture;
use super::unknowns::Unknowns;

tactnet_catching_packets::settings! {
    /// Settings of a slip detector.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct SlipConfig in "slip.": CalibrationError {
        /// Number of innovations per window.
        pub window: usize = 50 => positive,
        /// Upper limit of a normalised square.
        pub clip: f64 = 30.0 => positive,
        /// Mean over the window above which the calibration counts as invalid.
        pub limit: f64 = 10.0 => positive,
    }
}

/// Slip detector.
#[derive(Debug, Clone)]
pub struct SlipWatch {
    config: SlipConfig,
    squares: VecDeque<f64>,
    innovations: u64,
}

impl SlipWatch {
    /// Creates a detector without innovations.
    ///
    /// # Errors
    /// Returns an error if a setting is invalid.
    pub fn new(config: SlipConfig) -> Result<Self, CalibrationError> {
        config.check_settings()?;
        Ok(Self {
            config,
            squares: VecDeque::with_capacity(config.window),
            innovations: 0,
        })
    }

    /// Returns the number of innovations so far.
    pub fn innovations(&self) -> u64 {
        self.innovations
    }

    /// Returns true if the window is full.
    pub fn is_full(&self) -> bool {
        self.squares.len() == self.config.window
    }

    /// Returns the mean normalised square of the window, or `None` before the first innovation.
    pub fn mean(&self) -> Option<f64> {
        let count = self.squares.len();
        (count > 0).then(|| self.squares.iter().sum::<f64>() / count as f64)
    }

    /// Adds an innovation, in pixels, with its covariance. Returns the mean normalised square, which is 2 for a valid
    /// calibration, if it exceeds the limit and a new calibration is needed. Non-finite values are ignored.
    pub fn push(&mut self, innovation: &Vector2<f64>, covariance: &Matrix2<f64>) -> Option<f64> {
        let square = covariance
            .cholesky()
            .map(|factor| innovation.dot(&factor.solve(innovation)))
            .filter(|square| square.is_finite())?;
        if self.is_full() {
            self.squares.pop_front();
        }
        self.squares.push_back(square.min(self.config.clip));
        self.innovations += 1;
        self.mean()
            .filter(|mean| self.is_full() && *mean > self.config.limit)
    }

    /// Adds a marker's features in a pair of pictures.
    ///
    /// - `x`, `covariance`: parameters of the calibration and their covariance, `[UNKNOWNS][UNKNOWNS]`
    pub fn picture(
        &mut self,
        model: &Model,
        noise: &Noise,
        x: &Unknowns,
        covariance: &DMatrix<f64>,
        picture: &Picture,
    ) -> Option<f64> {
        let mut slip = None;
        for (camera, found) in picture.features.iter().enumerate() {
            let Some(found) = found else { continue };
            let Some(block) = model.feature_with_slope(x, picture, camera) else {
                continue;
            };
            // The Jacobian is zero beyond the columns.
            let slope = SMatrix::<f64, 2, 36>::from_fn(|row, column| block.jacobian[row][column]);
            let of_columns = SMatrix::<f64, 36, 36>::from_fn(|a, b| {
                match [a, b].map(|i| block.columns.get(i)) {
                    [Some(&a), Some(&b)] => covariance[(a, b)],
                    _ => 0.0,
                }
            });
            let noise = Matrix2::identity() * noise.feature.powi(2);
            let spread = slope * of_columns * slope.transpose() + noise;
            let innovation = Vector2::new(found[0] - block.value[0], found[1] - block.value[1]);
            slip = self.push(&innovation, &spread).or(slip);
        }
        slip
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Returns an approximately normal number: the sum of twelve uniform ones.
    fn normal(rng: &mut ChaCha8Rng) -> f64 {
        (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
    }

    #[test]
    fn noise_and_a_few_wrong_features_ask_for_nothing_and_a_jump_does() {
        let mut watch = SlipWatch::new(SlipConfig::default()).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let covariance = Matrix2::identity() * 0.09;
        let mut innovation = |jump: f64| {
            let wrong = 40.0 * f64::from(rng.random::<f64>() < 0.05);
            let mut noise = || 0.3 * normal(&mut rng);
            Vector2::new(noise() + jump + wrong, noise())
        };
        for _ in 0..20_000 {
            assert_eq!(watch.push(&innovation(0.0), &covariance), None);
        }
        assert_eq!(watch.innovations(), 20_000);
        assert!(watch.mean().is_some_and(|mean| mean < 10.0));
        let after = (1..).find(|_| watch.push(&innovation(3.0), &covariance).is_some());
        assert!(after.unwrap() <= 50, "{after:?}");
        let none = Vector2::new(f64::NAN, 0.0);
        assert_eq!(watch.push(&none, &covariance), None);
    }

    #[test]
    fn a_window_of_nothing_is_refused() {
        let config = SlipConfig {
            window: 0,
            ..SlipConfig::default()
        };
        let error = SlipWatch::new(config).unwrap_err().to_string();
        assert!(error.contains("slip.window"), "{error}");
    }
}
