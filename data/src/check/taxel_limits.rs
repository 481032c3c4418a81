//! Robust limits of the values of each taxel.

use super::fill_values::is_known_fill;
use crate::Dataset;

/// Maximum number of frames from which limits are estimated: the quantile below then rests on 40 values, and a check of a
/// large data set takes hardly longer.
const SAMPLED_FRAMES: usize = 4096;
/// Quantile of the deviations from the median that counts as the usual largest one: 1 % of foreign values do not move the
/// limit, and of a normal distribution it is 2.6 standard deviations.
const USUAL_QUANTILE: f64 = 0.99;
/// Minimum share of frames in which a taxel moves for its own limits to hold. The limits of other taxels are at least
/// the median limit, because few values show little of a taxel's range.
const ACTIVE_SHARE: f64 = 0.05;
/// Ratio of the usual deviations of two taxels above which they seem to have different units.
const OTHER_UNIT: f32 = 30.0;

/// Limits of the usual values of a taxel.
#[derive(Debug, Clone, Copy)]
pub(super) struct TaxelLimits {
    /// Median of the finite values.
    pub(super) median: f32,
    /// Usual largest deviation from the median; 0 if no taxel moves.
    pub(super) deviation: f32,
    /// Usual largest deviation of the taxels that seem to have the same unit.
    pub(super) deviation_of_alike: f32,
    /// Share of the values that differ from the median.
    pub(super) activity: f64,
}

impl TaxelLimits {
    /// Returns the limits of each taxel, from frames that are spread over all sweeps.
    pub(super) fn of_taxels(dataset: &Dataset) -> Vec<Self> {
        let taxels = dataset.shape().taxels();
        let frames = dataset.frames();
        let starts = FrameStarts::of(dataset);
        let sampled = frames.min(SAMPLED_FRAMES);
        let mut values = vec![0.0; sampled * taxels];
        for (number, frame) in values.chunks_exact_mut(taxels).enumerate() {
            let at = starts.place(sampled_frame(number, sampled, frames));
            dataset.samples().copy_to(at * taxels, frame);
        }
        let own: Vec<Self> = (0..taxels)
            .map(|taxel| Self::of(values[taxel..].iter().step_by(taxels).copied()))
            .collect();
        let mut moving: Vec<f32> = own.iter().map(|limits| limits.deviation).collect();
        moving.retain(|deviation| *deviation > 0.0);
        moving.sort_by(f32::total_cmp);
        let usual = moving.get(moving.len() / 2).copied().unwrap_or(0.0);
        let at_least = |limits: Self| Self {
            deviation: if limits.activity < ACTIVE_SHARE {
                limits.deviation.max(usual)
            } else {
                limits.deviation
            },
            ..limits
        };
        let mut limits: Vec<Self> = own.into_iter().map(at_least).collect();
        for of_taxel in &mut limits {
            let same_unit = moving.iter().rev();
            let same_unit = same_unit
                .copied()
                .find(|other| *other <= OTHER_UNIT * of_taxel.deviation);
            of_taxel.deviation_of_alike = same_unit.unwrap_or(of_taxel.deviation);
        }
        limits
    }

    fn of(values: impl Iterator<Item = f32>) -> Self {
        let mut values: Vec<f32> = values.filter(|value| value.is_finite()).collect();
        // Fill values may be frequent; most values are none.
        let usual = values.iter().filter(|value| !is_known_fill(**value));
        if 2 * usual.count() > values.len() {
            values.retain(|value| !is_known_fill(*value));
        }
        let Some(middle) = values.len().checked_sub(1).map(|last| last / 2) else {
            return Self {
                median: 0.0,
                deviation: 0.0,
                deviation_of_alike: 0.0,
                activity: 0.0,
            };
        };
        let (_, &mut median, _) = values.select_nth_unstable_by(middle, f32::total_cmp);
        let all = values.len();
        let mut deviations: Vec<f32> = values.iter().map(|value| (value - median).abs()).collect();
        deviations.retain(|deviation| *deviation > 0.0);
        let place = (USUAL_QUANTILE * deviations.len() as f64) as usize;
        let activity = deviations.len() as f64 / all as f64;
        let deviation = match deviations.len() {
            0 => 0.0,
            moving => {
                let place = place.min(moving - 1);
                *deviations.select_nth_unstable_by(place, f32::total_cmp).1
            }
        };
        Self {
            median,
            deviation,
            deviation_of_alike: deviation,
            activity,
        }
    }

    /// Returns the deviation of `value` from the median, as a multiple of the usual largest one.
    pub(super) fn distance(&self, value: f32) -> f32 {
        if self.deviation > 0.0 {
            (value - self.median).abs() / self.deviation
        } else {
            0.0
        }
    }

    /// Returns the deviation of `value` from the median, as a multiple of the usual largest one of the taxels that seem to
    /// have the same unit.
    pub(super) fn distance_of_alike(&self, value: f32) -> f32 {
        if self.deviation_of_alike > 0.0 {
            (value - self.median).abs() / self.deviation_of_alike
        } else {
            0.0
        }
    }
}

/// Places of the frames of sweeps that are padded to one length.
struct FrameStarts {
    /// Number of frames before each sweep; empty if all sweeps have one length.
    before: Vec<usize>,
    /// Number of frames of a padded sweep.
    padded: usize,
}

impl FrameStarts {
    fn of(dataset: &Dataset) -> Self {
        let lengths = dataset.lengths().unwrap_or_default();
        let before = lengths.iter().scan(0, |sum, steps| {
            *sum += steps;
            Some(*sum - steps)
        });
        Self {
            before: before.collect(),
            padded: dataset.shape().steps,
        }
    }

    /// Returns the place of a frame, which is counted without padding.
    fn place(&self, frame: usize) -> usize {
        match self.before.partition_point(|before| *before <= frame) {
            0 => frame,
            next => (next - 1) * self.padded + frame - self.before[next - 1],
        }
    }
}

/// Returns the index of a sampled frame: all frames of small data sets, otherwise one of each stretch of frames, at a
/// place in it that does not repeat with the sweeps.
fn sampled_frame(number: usize, sampled: usize, frames: usize) -> usize {
    let stretch = frames / sampled;
    number * stretch + number * 7919 % stretch
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_foreign_values_do_not_move_the_limits() {
        let usual = (0..1010).map(|i| (i % 101) as f32);
        let limits = TaxelLimits::of(usual.clone().chain([1e20, -9999.0, 12345.0, f32::NAN]));
        assert_eq!((limits.median, limits.deviation), (50.0, 50.0));
        assert!(limits.distance(1e20) > 1e17 && limits.distance(120.0) < 2.0);
        let alone = TaxelLimits::of(usual);
        assert_eq!(alone.median, limits.median);
    }
}
