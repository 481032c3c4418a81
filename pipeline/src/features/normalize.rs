//! From digits to what the network sees, fitted on training sweeps only.

use serde::{Deserialize, Serialize};
use tactnet_data::{SweepShape, SweepView, TrainSplit};

use crate::MeanRemoval;

/// What to fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scaling {
    /// Raw digits, as published for TactMat.
    #[default]
    Digits,
    /// Every taxel by its mean and standard deviation over all steps of the training sweeps.
    PerTaxel,
}

/// A fitted normaliser: levels kept or removed, then `(digit - offset) * gain` per taxel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normalizer {
    /// `[taxels]`, digits
    offset: Vec<f32>,
    /// `[taxels]`, per digit
    gain: Vec<f32>,
    #[serde(default, skip_serializing_if = "MeanRemoval::is_none")]
    levels: MeanRemoval,
}

impl Normalizer {
    /// Fits `scaling` to the training sweeps; a taxel that never changes keeps a gain of one.
    pub fn fit(scaling: Scaling, levels: MeanRemoval, train: &TrainSplit<'_>) -> Self {
        let taxels = train.shape().taxels();
        match scaling {
            Scaling::Digits => Self {
                offset: vec![0.0; taxels],
                gain: vec![1.0; taxels],
                levels,
            },
            Scaling::PerTaxel => per_taxel(train, levels),
        }
    }

    /// Returns what is subtracted: `[taxels]`, digits.
    pub fn offset(&self) -> &[f32] {
        &self.offset
    }

    /// Returns what is multiplied with then: `[taxels]`, per digit.
    pub fn gain(&self) -> &[f32] {
        &self.gain
    }

    /// Returns a difference of so many digits as the network sees it: `[taxels]`.
    pub fn scaled(&self, digits: f64) -> Vec<f32> {
        let scaled = self.gain.iter().map(|gain| digits as f32 * gain);
        scaled.collect()
    }

    /// Number of taxels it was fitted to.
    pub fn taxels(&self) -> usize {
        self.offset.len()
    }

    /// Returns true if it has an offset and a gain for each of so many taxels.
    pub fn is_of(&self, taxels: usize) -> bool {
        (self.offset.len(), self.gain.len()) == (taxels, taxels)
    }

    /// Scales whole sweeps in place: `[sweeps][steps][taxels]` digits.
    ///
    /// # Panics
    /// If the values are not whole sweeps of `shape`, or `shape` has another number of taxels.
    pub fn apply(&self, values: &mut [f32], shape: SweepShape) {
        assert_eq!(shape.taxels(), self.taxels(), "taxels of a frame");
        self.levels.apply(values, shape);
        for frame in values.chunks_exact_mut(self.taxels()) {
            self.scale(frame);
        }
    }

    /// Returns what is done to a frame after its sweep's levels were kept or removed.
    fn scale(&self, frame: &mut [f32]) {
        for ((value, offset), gain) in frame.iter_mut().zip(&self.offset).zip(&self.gain) {
            *value = (*value - offset) * gain;
        }
    }

    /// Scales one frame in place, `[taxels]` digits, while its sweep is still going on.
    ///
    /// # Panics
    /// If it has another number of taxels, or needs the whole sweep ([`Normalizer::needs_whole_sweep`]).
    pub fn apply_to_frame(&self, frame: &mut [f32]) {
        assert_eq!(frame.len(), self.taxels(), "taxels of a frame");
        assert!(!self.needs_whole_sweep(), "levels of a whole sweep");
        self.scale(frame);
    }

    /// Returns true if it removes levels, which are known only after the last frame.
    pub fn needs_whole_sweep(&self) -> bool {
        !self.levels.is_none()
    }
}

/// Two passes in `f64`: means first, then squared deviations, so that large offsets do not cost digits.
fn per_taxel(train: &SweepView<'_>, levels: MeanRemoval) -> Normalizer {
    let taxels = train.shape().taxels();
    let frames = (train.len() * train.shape().steps) as f64;
    let mut mean = vec![0.0_f64; taxels];
    for_each_frame(train, levels, |frame| {
        mean.iter_mut()
            .zip(frame)
            .for_each(|(m, v)| *m += f64::from(*v));
    });
    mean.iter_mut().for_each(|m| *m /= frames);
    let mut variance = vec![0.0_f64; taxels];
    for_each_frame(train, levels, |frame| {
        for ((sum, v), m) in variance.iter_mut().zip(frame).zip(&mean) {
            *sum += (f64::from(*v) - m).powi(2);
        }
    });
    let gain = variance
        .iter()
        .map(|sum| (sum / frames).sqrt())
        .map(|deviation| {
            if deviation > 0.0 {
                (1.0 / deviation) as f32
            } else {
                1.0
            }
        })
        .collect();
    Normalizer {
        offset: mean.iter().map(|m| *m as f32).collect(),
        gain,
        levels,
    }
}

fn for_each_frame(view: &SweepView<'_>, levels: MeanRemoval, mut visit: impl FnMut(&[f32])) {
    let shape = view.shape();
    let mut sweep = vec![0.0; shape.values()];
    for position in 0..view.len() {
        view.copy_batch(&[position], &mut sweep);
        levels.apply(&mut sweep, shape);
        sweep.chunks_exact(shape.taxels()).for_each(&mut visit);
    }
}
