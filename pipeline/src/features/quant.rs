//! QUANT: quantiles over intervals of every taxel's sweep, of its changes and of its spectrum (Dempster, Schmidt & Webb, 2024).
//!
//! Intervals are the halves, quarters, … of a representation, and the same intervals moved by half their length. Layout and rules follow aeon 1.6
//! (`QUANTTransformer`), so that features are equal (`tests/golden/features_with_aeon.py`).

use std::sync::Arc;

use realfft::{RealFftPlanner, RealToComplex};
use tactnet_data::SweepShape;

use crate::PipelineError;
use crate::features::series::Series;

/// Number of divisions into intervals: 1, 2, 4, … 32 parts.
const DEPTH: usize = 6;
/// Number of steps of an interval for each quantile.
const DIVISOR: usize = 4;
/// Number of steps of the running mean of the first difference.
const SMOOTHED: usize = 5;
/// Minimum number of steps of a sweep, which has one second difference.
const LEAST_STEPS: usize = 3;

/// Extractor of quantiles for sweeps of one shape.
pub(crate) struct Quant {
    taxels: usize,
    steps: usize,
    /// Intervals of the sweep, its smoothed first difference, its second difference, and its spectrum.
    intervals: [Vec<Interval>; 4],
    transform: Arc<dyn RealToComplex<f64>>,
    /// Factor of the spectrum that makes up for another number of steps than in the longest sweep.
    gain: f64,
}

/// Interval of a representation, `start..end`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Interval {
    start: usize,
    end: usize,
    /// Number of quantiles, evenly spaced from the smallest value to the largest; a single one is the median.
    quantiles: usize,
}

impl Quant {
    /// For sweeps of `shape`.
    ///
    /// # Errors
    /// Sweeps of fewer than three steps.
    pub fn new(shape: SweepShape) -> Result<Self, PipelineError> {
        Self::check(shape)?;
        Ok(Self {
            taxels: shape.taxels(),
            steps: shape.steps,
            intervals: lengths(shape.steps).map(intervals),
            transform: RealFftPlanner::new().plan_fft_forward(shape.steps),
            gain: 1.0,
        })
    }

    /// Succeeds if the features exist for sweeps of this shape.
    ///
    /// # Errors
    /// Sweeps of fewer than three steps.
    pub fn check(shape: SweepShape) -> Result<(), PipelineError> {
        if shape.steps >= LEAST_STEPS {
            return Ok(());
        }
        Err(PipelineError::incompatible(
            "sweeps",
            format!("at least {LEAST_STEPS} steps for a second difference"),
            format!("{} steps", shape.steps),
        ))
    }

    /// Returns the extractor of sweeps of another length, with as many quantiles of intervals at the same shares of a sweep and the same frequencies.
    pub fn at_length(&self, steps: usize) -> Self {
        let (from, to) = (lengths(self.steps), lengths(steps));
        let scaled = |index: usize| {
            let own = self.intervals[index].iter();
            own.map(|interval| interval.scaled(from[index], to[index]))
                .collect()
        };
        Self {
            taxels: self.taxels,
            steps,
            intervals: std::array::from_fn(scaled),
            transform: RealFftPlanner::new().plan_fft_forward(steps),
            gain: self.steps as f64 / steps as f64,
        }
    }

    /// Returns the number of features.
    pub fn width(&self) -> usize {
        self.taxels * self.width_of_taxel()
    }

    /// Returns the number of features of each taxel.
    pub fn width_of_taxel(&self) -> usize {
        let all = self.intervals.iter().flatten();
        all.map(|interval| interval.quantiles).sum()
    }

    /// Writes the features of one sweep, `[steps][taxels]`: by taxel, representation, interval and quantile. Every second quantile of an interval
    /// is relative to the interval's mean.
    pub fn write(&self, sweep: &[f32], out: &mut [f32]) {
        let series = Series::from_frames(sweep, self.taxels);
        let mut sorted = Vec::with_capacity(self.steps);
        for (taxel, mut rest) in out.chunks_exact_mut(self.width_of_taxel()).enumerate() {
            let values = series.taxel(taxel);
            let change = differences(values);
            let second = differences(&change);
            let (smooth, spectrum) = (smoothed(&change), self.spectrum(values));
            let representations: [&[f32]; 4] = [values, &smooth, &second, &spectrum];
            for (values, intervals) in representations.iter().zip(&self.intervals) {
                for interval in intervals {
                    let (own, after) = std::mem::take(&mut rest).split_at_mut(interval.quantiles);
                    write_quantiles(&values[interval.start..interval.end], &mut sorted, own);
                    rest = after;
                }
            }
        }
    }

    /// Returns the magnitudes of the Fourier transform.
    fn spectrum(&self, values: &[f32]) -> Vec<f32> {
        let mut input: Vec<f64> = values.iter().map(|value| f64::from(*value)).collect();
        let mut spectrum = self.transform.make_output_vec();
        self.transform
            .process(&mut input, &mut spectrum)
            .unwrap_or_else(|error| panic!("buffers have the lengths of the plan: {error}"));
        let bins = spectrum.iter();
        bins.map(|bin| (self.gain * bin.norm()) as f32).collect()
    }
}

impl Interval {
    /// Returns the interval at the same shares of a representation of length `to` instead of `from`; it has at least one value.
    fn scaled(self, from: usize, to: usize) -> Self {
        let end = (self.end * to / from).max(1);
        Self {
            start: (self.start * to / from).min(end - 1),
            end,
            ..self
        }
    }
}

/// Returns the lengths of the representations of a sweep: itself, its first and second difference, its spectrum.
fn lengths(steps: usize) -> [usize; 4] {
    [steps, steps - 1, steps - 2, steps / 2 + 1]
}

/// Returns the intervals of a representation: by division; those of a division before the same ones moved by half their length.
fn intervals(length: usize) -> Vec<Interval> {
    let interval = |start: usize, end: usize| Interval {
        start,
        end,
        quantiles: 1 + (end - start - 1) / DIVISOR,
    };
    let mut all = Vec::new();
    for division in 0..DEPTH.min(length.ilog2() as usize + 1) {
        let parts = 1 << division;
        let edge = |part: usize| part * length / parts;
        let own = (0..parts).map(|part| interval(edge(part), edge(part + 1)));
        let own: Vec<Interval> = own.collect();
        all.extend(&own);
        let several = own.iter().filter(|part| part.end - part.start > 1).count();
        // Intervals of single values are not moved: aeon asks whether the median length is above one.
        if several > parts / 2 && parts > 1 {
            let shift = length.div_ceil(2 * parts);
            let moved = own[..parts - 1].iter();
            all.extend(moved.map(|part| interval(part.start + shift, part.end + shift)));
        }
    }
    all
}

/// Returns the change from each value to the next.
fn differences(values: &[f32]) -> Vec<f32> {
    values.windows(2).map(|pair| pair[1] - pair[0]).collect()
}

/// Returns the running mean of five values; the first and the last value continue beyond the ends.
fn smoothed(values: &[f32]) -> Vec<f32> {
    let (reach, last) = (SMOOTHED / 2, values.len() - 1);
    let mean = |at: usize| {
        let around = (at..at + SMOOTHED).map(|next| next.saturating_sub(reach).min(last));
        let sum: f64 = around.map(|near| f64::from(values[near])).sum();
        (sum / SMOOTHED as f64) as f32
    };
    (0..values.len()).map(mean).collect()
}

/// Writes evenly spaced quantiles of `values`; of every second one the mean is subtracted.
///
/// - `sorted`: memory
fn write_quantiles(values: &[f32], sorted: &mut Vec<f32>, out: &mut [f32]) {
    sorted.clear();
    sorted.extend_from_slice(values);
    sorted.sort_unstable_by(f32::total_cmp);
    let last = values.len() - 1;
    if let [median] = out {
        *median = at_share(sorted, last, 2);
        return;
    }
    let sum: f64 = values.iter().map(|value| f64::from(*value)).sum();
    let mean = sum / values.len() as f64;
    let gaps = out.len() - 1;
    for (index, out) in out.iter_mut().enumerate() {
        let quantile = at_share(sorted, index * last, gaps);
        *out = match index % 2 {
            1 => (f64::from(quantile) - mean) as f32,
            _ => quantile,
        };
    }
}

/// Returns the value at position `numerator / denominator`, by linear interpolation between neighbours.
fn at_share(sorted: &[f32], numerator: usize, denominator: usize) -> f32 {
    let (below, rest) = (numerator / denominator, numerator % denominator);
    let low = sorted[below];
    if rest == 0 {
        return low;
    }
    let weight = rest as f32 / denominator as f32;
    low + weight * (sorted[below + 1] - low)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quant(steps: usize) -> Quant {
        let shape = SweepShape {
            steps,
            rows: 1,
            cols: 2,
        };
        Quant::new(shape).unwrap()
    }

    fn features(quant: &Quant, sweep: &[f32]) -> Vec<f32> {
        let mut out = vec![0.0; quant.width()];
        quant.write(sweep, &mut out);
        out
    }

    #[test]
    fn intervals_are_divisions_and_the_same_moved_by_half_their_length() {
        let ends: Vec<_> = intervals(6).iter().map(|i| (i.start, i.end)).collect();
        // Quarters have one or two steps each, as many of one kind as of the other, and are not moved.
        let quarters = [(0, 1), (1, 3), (3, 4), (4, 6)];
        assert_eq!(ends[..4], [(0, 6), (0, 3), (3, 6), (2, 5)]);
        assert_eq!(ends[4..], quarters);
        for length in 1..200 {
            for interval in intervals(length) {
                assert!(interval.start < interval.end && interval.end <= length);
            }
        }
    }

    #[test]
    fn quantiles_lie_between_the_values_and_every_second_one_around_the_mean() {
        let mut out = [0.0; 3];
        write_quantiles(&[4.0, 0.0, 1.0, 9.0], &mut Vec::new(), &mut out);
        // The mean is 3.5, the median 2.5.
        assert_eq!(out, [0.0, -1.0, 9.0]);
        write_quantiles(&[4.0, 0.0, 1.0, 9.0], &mut Vec::new(), &mut out[..1]);
        assert_eq!(out[0], 2.5);
    }

    /// A sweep at another speed has nearly the same quantiles of levels, and its tones have the same heights.
    #[test]
    fn a_sweep_of_another_length_has_the_same_features_at_the_same_shares() {
        let tone = |steps: usize| -> Vec<f32> {
            let at = |step: usize| (step as f32 / steps as f32 * 6.0 * std::f32::consts::TAU).sin();
            let frame = |step| [50.0 + 20.0 * at(step), 10.0 * at(step)];
            (0..steps).flat_map(frame).collect()
        };
        let whole = quant(400);
        let shorter = whole.at_length(300);
        assert_eq!(shorter.width(), whole.width());
        let (expected, found) = (features(&whole, &tone(400)), features(&shorter, &tone(300)));
        let widths = whole.intervals.each_ref().map(|intervals| -> usize {
            intervals.iter().map(|interval| interval.quantiles).sum()
        });
        let same = |range: std::ops::Range<usize>, tolerance: f32| {
            for (expected, found) in expected[range.clone()].iter().zip(&found[range]) {
                assert!((expected - found).abs() <= tolerance, "{expected} {found}");
            }
        };
        // Ends of intervals move by up to a step, in which the tone changes by up to 20 * 6 * tau / 300.
        same(0..widths[0], 2.6);
        // The largest magnitude, the sum of the levels, is the last quantile of the whole spectrum: 50 * 400.
        let start = widths[0] + widths[1] + widths[2];
        let of_whole = whole.intervals[3][0].quantiles;
        same(start + of_whole - 1..start + of_whole, 1.0);
        assert!((expected[start + of_whole - 1] - 20_000.0).abs() < 1.0);
        assert_eq!(whole.at_length(400).intervals, whole.intervals);
    }
}
