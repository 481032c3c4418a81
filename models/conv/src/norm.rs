//! Batch normalisation around a max-pool that keeps only the winners.
//!
//! With `y` the convolution's output, a map's block output is `max(0, max_window(scale * y + shift))`. As `scale * y + shift` is
//! monotone in `y`, the window's winner is the largest `y` (the smallest if gamma is negative). So the winner is known before the batch
//! statistics are. Only winners receive a gradient `g`; the contribution of the normalisation is affine in `y`:
//!
//! `dy = ka * g + kb + kc * y`, with `ka = gamma / sigma`, `kc = -ka * dgamma / (n sigma)`, `kb = -ka * dbeta / n - kc * mean`.

use rayon::prelude::*;

use super::shape::BlockShape;

/// Added to the variance before its square root.
const EPSILON: f64 = 1e-5;
/// Number of cells that are summed in f32 before the sum continues in f64.
const RUN: usize = 512;

/// Mean and sum of squared deviations per map over `count` values; merged in a fixed order, so that results do not depend on threads.
#[derive(Debug, Clone)]
pub(super) struct Moments {
    count: f64,
    mean: Vec<f64>,
    deviation: Vec<f64>,
}

impl Moments {
    pub(super) fn new(maps: usize) -> Self {
        Self {
            count: 0.0,
            mean: vec![0.0; maps],
            deviation: vec![0.0; maps],
        }
    }

    /// Adds `count` values of the maps from `map` on, given as sums and sums of squares of `y - pivot`.
    ///
    /// Update of Chan, Golub & LeVeque; a pivot near the mean avoids the cancellation of `E[y^2] - mean^2`.
    pub(super) fn add_shifted(
        &mut self,
        count: usize,
        pivot: &[f32],
        sum: &[f32],
        squares: &[f32],
    ) {
        let (n, more) = (self.count, count as f64);
        for (map, ((&pivot, &sum), &squares)) in pivot.iter().zip(sum).zip(squares).enumerate() {
            let offset = f64::from(sum) / more;
            let deviation = f64::from(squares) - f64::from(sum) * offset;
            let step = f64::from(pivot) + offset - self.mean[map];
            self.mean[map] += step * more / (n + more);
            self.deviation[map] += deviation.max(0.0) + step * step * n * more / (n + more);
        }
        self.count += more;
    }

    /// Adds the values of `other` by the same update.
    pub(super) fn merge(&mut self, other: &Self) {
        let (n, more) = (self.count, other.count);
        for (map, (&mean, &deviation)) in other.mean.iter().zip(&other.deviation).enumerate() {
            let step = mean - self.mean[map];
            self.mean[map] += step * more / (n + more);
            self.deviation[map] += deviation + step * step * n * more / (n + more);
        }
        self.count += more;
    }

    pub(super) fn mean(&self) -> Vec<f32> {
        self.mean.iter().map(|&m| m as f32).collect()
    }

    /// Returns the biased variance.
    pub(super) fn variance(&self) -> Vec<f32> {
        self.deviation
            .iter()
            .map(|&d| (d / self.count) as f32)
            .collect()
    }
}

/// Map `y -> scale * y + shift` per map, with the values for its gradient.
#[derive(Debug, Clone)]
pub(super) struct Normalizer {
    pub(super) scale: Vec<f32>,
    pub(super) shift: Vec<f32>,
    mean: Vec<f32>,
    inverse_deviation: Vec<f32>,
}

/// Coefficients of `dy = ka * g + kb + kc * y` per map, and the gradients of gamma and beta.
#[derive(Debug, Clone)]
pub(super) struct GradientAffine {
    pub(super) ka: Vec<f32>,
    pub(super) kb: Vec<f32>,
    pub(super) kc: Vec<f32>,
    pub(super) gamma: Vec<f32>,
    pub(super) beta: Vec<f32>,
}

/// Winners of all pooling windows, their step in the window, and the batch moments of all values.
pub(super) struct Pooled {
    pub(super) winners: Vec<f32>,
    pub(super) positions: Vec<u8>,
    /// `None` with fixed statistics.
    pub(super) moments: Option<Moments>,
}

/// Gradient of the winners, zero where ReLU is inactive, with their steps and the affine part.
#[derive(Clone, Copy)]
pub(super) struct OutputGradient<'a> {
    pub(super) gradient: &'a [f32],
    pub(super) positions: &'a [u8],
    pub(super) affine: &'a GradientAffine,
}

impl Normalizer {
    pub(super) fn new(mean: &[f32], variance: &[f32], gamma: &[f32], beta: &[f32]) -> Self {
        let mut made = Self {
            scale: Vec::with_capacity(mean.len()),
            shift: Vec::with_capacity(mean.len()),
            mean: mean.to_vec(),
            inverse_deviation: Vec::with_capacity(mean.len()),
        };
        for (map, (&mean, &variance)) in mean.iter().zip(variance).enumerate() {
            let inverse = 1.0 / (f64::from(variance) + EPSILON).sqrt();
            let scale = f64::from(gamma[map]) * inverse;
            made.scale.push(scale as f32);
            made.shift
                .push((f64::from(beta[map]) - f64::from(mean) * scale) as f32);
            made.inverse_deviation.push(inverse as f32);
        }
        made
    }

    /// Writes the outputs `max(0, scale * y + shift)` of the winners `y`.
    pub(super) fn rectify(&self, winners: &[f32], out: &mut [f32]) {
        let maps = self.scale.len();
        out.par_chunks_mut(maps * RUN)
            .zip(winners.par_chunks(maps * RUN))
            .for_each(|(out, winners)| {
                for (out, y) in out.chunks_exact_mut(maps).zip(winners.chunks_exact(maps)) {
                    for (((out, &y), &scale), &shift) in
                        out.iter_mut().zip(y).zip(&self.scale).zip(&self.shift)
                    {
                        *out = (scale * y + shift).max(0.0);
                    }
                }
            });
    }

    /// Copies the gradient to `gated`, with zeros where ReLU is inactive, and returns the affine part.
    ///
    /// `gradient`, `winners` and `gated` are `[batch, pooled_steps, taxels, maps_out]`.
    pub(super) fn backward(
        &self,
        shape: &BlockShape,
        gradient: &[f32],
        winners: &[f32],
        gated: &mut [f32],
    ) -> GradientAffine {
        let maps = self.scale.len();
        // Short f32 runs, whose sums are added in f64 in a fixed order.
        let runs: Vec<(Vec<f32>, Vec<f32>)> = gated
            .par_chunks_mut(maps * RUN)
            .zip(gradient.par_chunks(maps * RUN))
            .zip(winners.par_chunks(maps * RUN))
            .map(|((gated, gradient), winners)| self.gate(gradient, winners, gated))
            .collect();
        let (mut beta, mut gamma) = (vec![0f64; maps], vec![0f64; maps]);
        for (sum, weighted) in &runs {
            for map in 0..maps {
                beta[map] += f64::from(sum[map]);
                gamma[map] += f64::from(weighted[map]) * f64::from(self.inverse_deviation[map]);
            }
        }
        self.affine(shape.count() as f64, &gamma, &beta)
    }

    /// Writes one run's gated gradient; returns its sum and its sum weighted with `y - mean`, per map.
    fn gate(&self, gradient: &[f32], winners: &[f32], gated: &mut [f32]) -> (Vec<f32>, Vec<f32>) {
        let maps = self.scale.len();
        let (mut sum, mut weighted) = (vec![0f32; maps], vec![0f32; maps]);
        for ((gated, gradient), winners) in gated
            .chunks_exact_mut(maps)
            .zip(gradient.chunks_exact(maps))
            .zip(winners.chunks_exact(maps))
        {
            let rows = gated
                .iter_mut()
                .zip(gradient)
                .zip(winners)
                .zip(self.scale.iter().zip(&self.shift));
            for ((((gated, &g), &y), (&scale, &shift)), ((sum, weighted), &mean)) in
                rows.zip(sum.iter_mut().zip(weighted.iter_mut()).zip(&self.mean))
            {
                let g = if scale * y + shift > 0.0 { g } else { 0.0 };
                *gated = g;
                *sum += g;
                *weighted += g * (y - mean);
            }
        }
        (sum, weighted)
    }

    fn affine(&self, count: f64, gamma: &[f64], beta: &[f64]) -> GradientAffine {
        let terms = |map: usize| {
            let ka = f64::from(self.scale[map]);
            let kc = -ka * f64::from(self.inverse_deviation[map]) * gamma[map] / count;
            (
                ka,
                -ka * beta[map] / count - kc * f64::from(self.mean[map]),
                kc,
            )
        };
        let maps = 0..gamma.len();
        GradientAffine {
            ka: self.scale.clone(),
            kb: maps.clone().map(|map| terms(map).1 as f32).collect(),
            kc: maps.map(|map| terms(map).2 as f32).collect(),
            gamma: gamma.iter().map(|&g| g as f32).collect(),
            beta: beta.iter().map(|&b| b as f32).collect(),
        }
    }
}
