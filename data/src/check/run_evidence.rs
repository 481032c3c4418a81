//! Information in a run of frames: minus the logarithm of the probability that an independent sweep has the same run.

use std::cell::OnceCell;
use std::collections::HashMap;
use std::sync::OnceLock;

use super::noise::noise;
use super::series::Series;
use super::shared_frames::SharedRun;

/// Number of taxels from which two of them are independent: their common force and their noise.
const INDEPENDENT_TAXELS: usize = 4;
/// Number of times that neighbouring frames are subtracted from each other: the second and third differences of a smooth
/// curve repeat few values, those of noise do not.
const ORDERS: usize = 3;

/// Number of frames that are looked at first: most runs have enough information in them.
const FIRST_FRAMES: usize = 128;

/// Values of a sweep.
pub(super) struct Evidence {
    /// Values: `[steps][taxels]`.
    values: Vec<f32>,
    taxels: usize,
    /// Signals, computed when needed; `None` for a predictable signal, which carries no information.
    noisy: Vec<(Series, OnceLock<Option<Vec<f32>>>)>,
}

impl Evidence {
    /// Returns the values of a sweep, `[steps][taxels]`.
    pub(super) fn of(values: Vec<f32>, taxels: usize) -> Self {
        let series = Series::of_taxels(taxels).chain([Series::Sparse]);
        Self {
            values,
            taxels,
            noisy: series.map(|series| (series, OnceLock::new())).collect(),
        }
    }

    /// Returns true if a run has more information than `needed`, in bits: all taxels together, and the most lively
    /// signal alone, which counts twice if there are several taxels.
    pub(super) fn exceeds(&self, run: SharedRun, needed: f64) -> bool {
        let first = SharedRun {
            frames: run.frames.min(FIRST_FRAMES),
            ..run
        };
        self.has_more(first, needed) || (first != run && self.has_more(run, needed))
    }

    fn has_more(&self, run: SharedRun, needed: f64) -> bool {
        let end = run.start + run.frames;
        let frames = &self.values[run.start * self.taxels..end * self.taxels];
        let together = OnceCell::new();
        (0..self.noisy.len()).any(|place| {
            let Some(signal) = self.noisy(place) else {
                return false;
            };
            let alone = information(&signal[run.start..end], 1);
            // All taxels have at least the information of one.
            let counts_twice = self.taxels >= INDEPENDENT_TAXELS && 2.0 * alone > needed;
            alone > needed
                || (counts_twice
                    && *together.get_or_init(|| information(frames, self.taxels) > needed))
        })
    }

    fn noisy(&self, place: usize) -> Option<&[f32]> {
        let (series, signal) = &self.noisy[place];
        let signal = signal.get_or_init(|| {
            let values = series.of(&self.values, self.taxels);
            noise(&values)?;
            Some(values.into_iter().map(|value| value as f32).collect())
        });
        signal.as_deref()
    }
}

/// Returns the information of frames of `taxels` values, in bits. It is estimated from the share of equal pairs among
/// the changes between frames; frames that equal the one before carry none.
fn information(frames: &[f32], taxels: usize) -> f64 {
    let moving = moving_frames(frames, taxels);
    let mut changes = moving.clone();
    let mut least = f64::INFINITY;
    for _ in 0..ORDERS {
        changes = subtracted(&changes, taxels);
        least = least.min(-bits(collision(&changes, taxels)));
    }
    (moving.len() / taxels).saturating_sub(1) as f64 * least
}

/// Returns the frames that differ from the one before.
fn moving_frames(frames: &[f32], taxels: usize) -> Vec<f32> {
    let mut moving: Vec<f32> = Vec::with_capacity(frames.len());
    for frame in frames.chunks_exact(taxels) {
        let is_repeated = moving
            .len()
            .checked_sub(taxels)
            .is_some_and(|last| moving[last..] == *frame);
        if !is_repeated {
            moving.extend_from_slice(frame);
        }
    }
    moving
}

/// Returns each frame minus the one before.
fn subtracted(frames: &[f32], taxels: usize) -> Vec<f32> {
    let after = frames.iter().skip(taxels);
    after
        .zip(frames)
        .map(|(after, before)| after - before)
        .collect()
}

/// Returns the probability that two frames are equal, estimated from all pairs.
fn collision(frames: &[f32], taxels: usize) -> f64 {
    let mut counts: HashMap<Vec<u32>, usize> = HashMap::new();
    for frame in frames.chunks_exact(taxels) {
        let frame = frame.iter().map(|value| (value + 0.0).to_bits());
        *counts.entry(frame.collect()).or_default() += 1;
    }
    let all: usize = counts.values().sum();
    let equal: usize = counts.values().map(|count| count * (count - 1)).sum();
    (1 + equal) as f64 / (1 + all * all.saturating_sub(1)) as f64
}

/// Returns the binary logarithm of a number above 0.
pub(super) fn bits(number: f64) -> f64 {
    number.max(f64::MIN_POSITIVE).log2()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Returns noise of two taxels with this number of levels: `[frames][2]`.
    pub(in crate::check) fn noise(seed: u64, frames: usize, levels: u64) -> Vec<f32> {
        let mut state = seed;
        let mut next = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 40) % levels) as f32
        };
        (0..2 * frames).map(|_| next()).collect()
    }

    #[test]
    fn ramps_curves_and_frames_at_rest_carry_little_information() {
        assert_eq!(information(&[7.0; 400], 2), 0.0);
        let curve = |of: fn(f32) -> f32| -> Vec<f32> { (0..40).map(|at| of(at as f32)).collect() };
        assert_eq!(information(&curve(|at| 3.0 * at), 1), 0.0);
        assert_eq!(information(&curve(|at| at * at), 1), 0.0);
        assert!(information(&curve(|at| (100.0 * (at * 0.1).sin()).round()), 1) < 60.0);
        assert!(information(&noise(1, 20, 2), 2) < 45.0);
        assert!(information(&noise(1, 20, 1000), 2) > 150.0);
    }

    #[test]
    fn a_predictable_signal_is_no_evidence() {
        let exceeds = |values: Vec<f32>| {
            let run = SharedRun {
                start: 50,
                frames: 100,
            };
            Evidence::of(values, 1).exceeds(run, 60.0)
        };
        assert!(!exceeds(
            (0..200).map(|at| (at as f32 * 0.3).sin()).collect()
        ));
        assert!(exceeds(noise(1, 100, 1000)));
    }
}
