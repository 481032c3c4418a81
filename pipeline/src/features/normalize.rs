//! Normalisation of digits for networks, fitted to training sweeps only.

use serde::{Deserialize, Serialize};
use tactnet_data::{SweepShape, SweepView, TrainSplit};

use crate::adapt::shift::{Moment, believed};
use crate::{MeanRemoval, Shift};

/// Scaling of digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// None: raw digits, as published for TactMat.
    #[default]
    Digits,
    /// Mean 0 and standard deviation 1 of every taxel over all steps of the training sweeps.
    PerTaxel,
}

/// Fitted normaliser: optional removal of means, then `(digit - offset) * gain` for each taxel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normalizer {
    /// Offset of each taxel, in digits.
    offset: Vec<f32>,
    /// Gain of each taxel, per digit.
    gain: Vec<f32>,
    #[serde(default, skip_serializing_if = "MeanRemoval::is_none")]
    levels: MeanRemoval,
    /// Number of conditions behind the taxels; see [`Dataset::conditions`](tactnet_data::Dataset::conditions).
    #[serde(default, skip_serializing_if = "is_zero")]
    conditions: usize,
}

fn is_zero(number: &usize) -> bool {
    *number == 0
}

impl Normalizer {
    /// Fits `scaling` to the training sweeps. A constant taxel has a gain of one.
    ///
    /// Conditions have mean 0 and the mean spread of a scaled taxel; a constant condition is zero whatever its value.
    pub fn fit(scaling: Scaling, levels: MeanRemoval, train: &TrainSplit<'_>) -> Self {
        let taxels = train.shape().taxels();
        let conditions = train.dataset().conditions().len();
        if scaling == Scaling::Digits && conditions == 0 {
            return Self {
                offset: vec![0.0; taxels],
                gain: vec![1.0; taxels],
                levels,
                conditions,
            };
        }
        let (mut scales, deviations) = per_taxel(train, levels);
        let skin = taxels - conditions;
        let spread = match scaling {
            Scaling::PerTaxel => 1.0,
            Scaling::Digits => {
                scales.offset[..skin].fill(0.0);
                scales.gain[..skin].fill(1.0);
                deviations[..skin].iter().sum::<f64>() / skin.max(1) as f64
            }
        };
        for (column, deviation) in deviations.iter().enumerate().skip(skin) {
            let rounding = f64::from(f32::EPSILON * scales.offset[column].abs());
            scales.gain[column] = match *deviation > rounding {
                true => (spread / deviation) as f32,
                false => 0.0,
            };
        }
        scales
    }

    /// Returns the number of conditions behind the taxels.
    pub(crate) fn conditions(&self) -> usize {
        self.conditions
    }

    /// Returns the normaliser of sweeps like `sweeps`: means and standard deviations change as far as they differ from those of the training
    /// sweeps beyond chance. Raw digits stay raw, without a shift.
    pub(crate) fn adapted(&self, sweeps: &SweepView<'_>) -> (Self, Option<Shift>) {
        if self.is_raw() {
            return (self.clone(), None);
        }
        let known = self.offset.iter().zip(&self.gain);
        let known: Vec<Moment> = known
            .map(|(offset, gain)| Moment {
                mean: f64::from(*offset),
                variance: f64::from(*gain).powi(-2),
            })
            .collect();
        let found: Vec<Vec<Moment>> = (0..sweeps.len())
            .map(|position| self.moments_of(sweeps, position))
            .collect();
        let (moments, shift) = believed(&known, &found);
        let adapted = Self {
            offset: moments.iter().map(|of| of.mean as f32).collect(),
            gain: moments
                .iter()
                .map(|of| of.variance.powf(-0.5) as f32)
                .collect(),
            levels: self.levels,
            conditions: self.conditions,
        };
        (adapted, Some(shift))
    }

    /// Returns true if it does not scale.
    fn is_raw(&self) -> bool {
        self.offset.iter().all(|offset| *offset == 0.0) && self.gain.iter().all(|gain| *gain == 1.0)
    }

    /// Returns mean and variance of every taxel over the steps of a sweep, in digits.
    fn moments_of(&self, sweeps: &SweepView<'_>, position: usize) -> Vec<Moment> {
        let (steps, taxels) = (sweeps.steps(position), self.taxels());
        let shape = SweepShape {
            steps,
            ..sweeps.shape()
        };
        let mut sweep = sweeps.sweep(position);
        self.levels
            .apply_to_taxels(&mut sweep, shape, self.conditions);
        let of_taxel = |taxel: usize| {
            let values = || sweep[taxel..].iter().step_by(taxels).map(|v| f64::from(*v));
            let mean = values().sum::<f64>() / shape.steps as f64;
            let squares = values().map(|value| (value - mean).powi(2));
            let variance = squares.sum::<f64>() / shape.steps as f64;
            Moment { mean, variance }
        };
        (0..taxels).map(of_taxel).collect()
    }

    /// Returns the offset of each taxel, in digits.
    pub fn offset(&self) -> &[f32] {
        &self.offset
    }

    /// Returns the gain of each taxel, per digit.
    pub fn gain(&self) -> &[f32] {
        &self.gain
    }

    /// Returns the normaliser of means and standard deviations of frames: `[frames][taxels]`.
    #[cfg(test)]
    pub(crate) fn of_frames(frames: &[f32], taxels: usize) -> Self {
        let count = (frames.len() / taxels) as f32;
        let of = |taxel: usize| frames.iter().skip(taxel).step_by(taxels);
        let offset: Vec<f32> = (0..taxels).map(|t| of(t).sum::<f32>() / count).collect();
        let variance = |t: usize| of(t).map(|v| (v - offset[t]).powi(2)).sum::<f32>() / count;
        let gain = (0..taxels).map(|t| 1.0 / variance(t).sqrt()).collect();
        Self {
            offset,
            gain,
            levels: MeanRemoval::None,
            conditions: 0,
        }
    }

    /// Returns a difference in digits after scaling, `[taxels]`.
    pub fn scaled(&self, digits: f64) -> Vec<f32> {
        let scaled = self.gain.iter().map(|gain| digits as f32 * gain);
        scaled.collect()
    }

    /// Returns the number of taxels that it was fitted to.
    pub fn taxels(&self) -> usize {
        self.offset.len()
    }

    /// Returns true if it has an offset and a gain for each of `taxels` taxels.
    pub fn is_of(&self, taxels: usize) -> bool {
        (self.offset.len(), self.gain.len()) == (taxels, taxels)
    }

    /// Scales complete sweeps in place: `[sweeps][steps][taxels]`, in digits.
    ///
    /// # Panics
    /// If the values are not complete sweeps of `shape`, or `shape` has another number of taxels.
    pub fn apply(&self, values: &mut [f32], shape: SweepShape) {
        assert_eq!(shape.taxels(), self.taxels(), "taxels of a frame");
        self.levels.apply_to_taxels(values, shape, self.conditions);
        for frame in values.chunks_exact_mut(self.taxels()) {
            self.scale(frame);
        }
    }

    /// Scales a frame, without removal of means.
    fn scale(&self, frame: &mut [f32]) {
        for ((value, offset), gain) in frame.iter_mut().zip(&self.offset).zip(&self.gain) {
            *value = (*value - offset) * gain;
        }
    }

    /// Scales one frame of an ongoing sweep in place, `[taxels]`, in digits.
    ///
    /// # Panics
    /// If it has another number of taxels, or needs the complete sweep ([`Normalizer::needs_whole_sweep`]).
    pub fn apply_to_frame(&self, frame: &mut [f32]) {
        assert_eq!(frame.len(), self.taxels(), "taxels of a frame");
        assert!(!self.needs_whole_sweep(), "levels of a whole sweep");
        self.scale(frame);
    }

    /// Returns true if it removes means, which are known only after the last frame.
    pub fn needs_whole_sweep(&self) -> bool {
        !self.levels.is_none()
    }
}

/// Returns offsets and gains, and the standard deviation of each taxel, from two passes in `f64`, means before squared deviations, so that large offsets do not cost precision.
fn per_taxel(train: &SweepView<'_>, levels: MeanRemoval) -> (Normalizer, Vec<f64>) {
    let taxels = train.shape().taxels();
    let frames = train.lengths().sum::<usize>() as f64;
    let mean = means(train, levels);
    let mut variance = vec![0.0_f64; taxels];
    for_each_frame(train, levels, |frame| {
        for ((sum, v), m) in variance.iter_mut().zip(frame).zip(&mean) {
            *sum += (f64::from(*v) - m).powi(2);
        }
    });
    let deviations: Vec<f64> = variance.iter().map(|sum| (sum / frames).sqrt()).collect();
    let gain = |deviation: &f64| match *deviation > 0.0 {
        true => (1.0 / deviation) as f32,
        false => 1.0,
    };
    let scales = Normalizer {
        offset: mean.iter().map(|m| *m as f32).collect(),
        gain: deviations.iter().map(gain).collect(),
        levels,
        conditions: train.dataset().conditions().len(),
    };
    (scales, deviations)
}

/// Maximum number of frames behind a median.
const MEDIAN_FRAMES: usize = 20_000;

/// Returns the median of each taxel over the training sweeps, in digits.
pub(crate) fn taxel_medians(train: &TrainSplit<'_>) -> Vec<f32> {
    let shape = train.shape();
    let every = (train.len() * shape.steps).div_ceil(MEDIAN_FRAMES);
    let mut values = vec![Vec::new(); shape.taxels()];
    let mut frames = 0;
    for_each_frame(train, MeanRemoval::None, |frame| {
        if frames % every == 0 {
            let taxels = values.iter_mut().zip(frame);
            taxels.for_each(|(of, value): (&mut Vec<f32>, _)| of.push(*value));
        }
        frames += 1;
    });
    let medians = values.iter_mut().map(|of| {
        let middle = of.len() / 2;
        *of.select_nth_unstable_by(middle, f32::total_cmp).1
    });
    medians.collect()
}

fn means(train: &SweepView<'_>, levels: MeanRemoval) -> Vec<f64> {
    let frames = train.lengths().sum::<usize>() as f64;
    let mut mean = vec![0.0_f64; train.shape().taxels()];
    for_each_frame(train, levels, |frame| {
        mean.iter_mut()
            .zip(frame)
            .for_each(|(m, v)| *m += f64::from(*v));
    });
    mean.iter_mut().for_each(|m| *m /= frames);
    mean
}

fn for_each_frame(view: &SweepView<'_>, levels: MeanRemoval, mut visit: impl FnMut(&[f32])) {
    let shape = view.shape();
    for position in 0..view.len() {
        let mut sweep = view.sweep(position);
        let steps = view.steps(position);
        let shape = SweepShape { steps, ..shape };
        levels.apply_to_taxels(&mut sweep, shape, view.dataset().conditions().len());
        sweep.chunks_exact(shape.taxels()).for_each(&mut visit);
    }
}
