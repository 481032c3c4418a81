//! All residuals of a session as one least-squares problem.
//!
//! `cost = 1/2 sum z^2 + sum rho(r)`, with the deviations `z` of the unknowns from their priors and the residuals `r`,
//! both in standard deviations. `rho` is Huber's loss: `r^2 / 2` up to its edge `d` and `d |r| - d^2 / 2` beyond.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::checks::positive;

use super::error::CalibrationError;
use super::model::{Block, Model};
use super::session::{NeckMotion, Picture, Rest, Session, Turn};
use super::unknowns::{Priors, UNKNOWNS, Unknowns};
use crate::track::CAMERAS;

/// Residual of a feature that the model cannot see, in pixels. Its gradient is zero.
const UNSEEN: f64 = 1000.0;

tactnet_catching_packets::settings! {
    /// Standard deviations of the measurements.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct Noise in "noise.": CalibrationError {
        /// Standard deviation of a feature per coordinate, in pixels.
        pub feature: f64 = 0.3 => positive,
        /// Standard deviation of an accelerometer mean at rest, including scale errors, in m/s^2.
        pub acceleration: f64 = 0.02 => positive,
        /// Standard deviation of a gyroscope sample in motion, in rad/s.
        pub rate: f64 = 0.002 => positive,
        /// Standard deviation of a gyroscope mean at rest, in rad/s.
        pub rest_rate: f64 = 0.0005 => positive,
    }
}

tactnet_catching_packets::settings! {
    /// Settings of a calibration.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct CalibrationConfig in "": CalibrationError {
        /// Priors of the unknowns.
        pub priors: Priors = Priors::default(),
        /// Measurement noise.
        pub noise: Noise = Noise::default(),
        /// Edge of Huber's loss, in standard deviations.
        pub huber: f64 = 1.5 => positive,
        /// Minimum number of configurations per arm.
        pub configurations: usize = 5,
        /// Maximum number of iterations.
        pub iterations: usize = 200,
        /// Maximum median feature residual, relative to the median of the noise.
        pub fit: f64 = 1.5 => positive,
        /// Maximum deviation of an unknown from its prior, in standard deviations.
        pub plausible: f64 = 6.0 => positive,
    }
}

/// Normal equations in standard deviations of the priors.
#[derive(Debug, Clone)]
pub struct Normal {
    /// Cost.
    pub cost: f64,
    /// Gradient of the cost, `[UNKNOWNS]`.
    pub gradient: DVector<f64>,
    /// Gauss-Newton Hessian, `[UNKNOWNS][UNKNOWNS]`.
    pub hessian: DMatrix<f64>,
}

/// Least-squares problem of a session.
#[derive(Debug, Clone)]
pub struct Problem<'a> {
    model: &'a Model,
    session: &'a Session,
    config: &'a CalibrationConfig,
    guess: Unknowns,
    sigmas: Unknowns,
}

impl<'a> Problem<'a> {
    /// Creates the problem.
    ///
    /// # Errors
    /// Returns an error if a setting is invalid.
    pub fn new(
        model: &'a Model,
        session: &'a Session,
        config: &'a CalibrationConfig,
    ) -> Result<Self, CalibrationError> {
        config.noise.check_settings()?;
        config.check_settings()?;
        Ok(Self {
            model,
            session,
            config,
            guess: config.priors.guess(),
            sigmas: config.priors.sigmas()?,
        })
    }

    /// Returns the settings.
    pub fn config(&self) -> &CalibrationConfig {
        self.config
    }

    /// Returns the standard deviations of the priors.
    pub fn sigmas(&self) -> &Unknowns {
        &self.sigmas
    }

    /// Returns the unknowns at `z` standard deviations from their priors.
    pub fn unknowns(&self, z: &DVector<f64>) -> Unknowns {
        &self.guess + self.sigmas.component_mul(z)
    }

    /// Returns the deviations of unknowns from their priors, in standard deviations.
    pub fn deviations(&self, x: &Unknowns) -> DVector<f64> {
        (x - &self.guess).component_div(&self.sigmas)
    }

    /// Returns the cost.
    pub fn cost(&self, z: &DVector<f64>) -> f64 {
        let x = self.unknowns(z);
        let mut cost = z.norm_squared() / 2.0;
        self.each(&x, |residuals, sigma| {
            let rows = residuals.value[..residuals.rows].iter();
            cost += rows.map(|value| self.rho(value / sigma)).sum::<f64>();
        });
        cost
    }

    /// Returns cost, gradient and Hessian. Rows beyond Huber's edge have a reduced weight.
    pub fn normal(&self, z: &DVector<f64>) -> Normal {
        let x = self.unknowns(z);
        let mut normal = Normal {
            cost: z.norm_squared() / 2.0,
            gradient: z.clone(),
            hessian: DMatrix::identity(UNKNOWNS, UNKNOWNS),
        };
        self.each(&x, |residuals, sigma| {
            for row in 0..residuals.rows {
                let r = residuals.value[row] / sigma;
                normal.cost += self.rho(r);
                let weight = (self.config.huber / r.abs()).min(1.0);
                let slope = &residuals.jacobian[row];
                for (i, &a) in residuals.columns.iter().enumerate() {
                    let by_a = slope[i] * self.sigmas[a] / sigma;
                    normal.gradient[a] += weight * r * by_a;
                    for (j, &b) in residuals.columns.iter().enumerate().take(i + 1) {
                        let product = weight * by_a * slope[j] * self.sigmas[b] / sigma;
                        normal.hessian[(a.max(b), a.min(b))] += product;
                    }
                }
            }
        });
        normal.hessian.fill_upper_triangle_with_lower_triangle();
        normal
    }

    /// Returns the norms of the features' residuals in pixels, in the order of the pictures.
    pub fn feature_residuals(&self, x: &Unknowns) -> Vec<f64> {
        self.features()
            .map(|(picture, camera, found)| {
                self.model
                    .feature(x, picture, camera)
                    .map_or(UNSEEN, |pixel| {
                        (pixel[0] - found[0]).hypot(pixel[1] - found[1])
                    })
            })
            .collect()
    }

    fn features(&self) -> impl Iterator<Item = (&'a Picture, usize, [f64; 2])> + use<'a> {
        self.session.pictures.iter().flat_map(|picture| {
            (0..CAMERAS)
                .filter_map(move |camera| Some((picture, camera, picture.features[camera]?)))
        })
    }

    /// Calls `take` with each unscaled residual and its standard deviation.
    fn each(&self, x: &Unknowns, mut take: impl FnMut(&Block, f64)) {
        let noise = &self.config.noise;
        for (picture, camera, found) in self.features() {
            match self.model.feature_with_slope(x, picture, camera) {
                Some(block) => take(&minus(block, &found), noise.feature),
                None => take(&Block::constant(UNSEEN), noise.feature),
            }
        }
        for rest in &self.session.rests {
            let Rest {
                neck,
                acceleration,
                rate,
                ..
            } = rest;
            let felt = self.model.rest(x, rest);
            take(&minus(felt, acceleration), noise.acceleration);
            let still = Turn {
                neck: NeckMotion::standing(*neck),
                rate: *rate,
            };
            take(&minus(self.model.turn(x, &still), rate), noise.rest_rate);
        }
        for turn in &self.session.turns {
            take(&minus(self.model.turn(x, turn), &turn.rate), noise.rate);
        }
    }

    fn rho(&self, r: f64) -> f64 {
        let edge = self.config.huber;
        if r.abs() <= edge {
            r * r / 2.0
        } else {
            edge * (r.abs() - edge / 2.0)
        }
    }
}

fn minus(mut block: Block, found: &[f64]) -> Block {
    for (value, found) in block.value.iter_mut().zip(found) {
        *value -= found;
    }
    block
}
