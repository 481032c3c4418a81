//! Ranges of values.

use serde::{Deserialize, Serialize};

use crate::SweepView;

/// Range of the values of some sweeps.
///
/// ```
/// use tactnet_data::ValueRange;
///
/// let range = ValueRange::of_frame(&[1.0, f32::NAN, 5.0]).unwrap();
/// assert_eq!((range.least, range.greatest, range.greatest_mean), (1.0, 5.0, 3.0));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ValueRange {
    /// Smallest value of a taxel.
    pub least: f32,
    /// Largest value of a taxel.
    pub greatest: f32,
    /// Largest mean of the finite values of a frame.
    pub greatest_mean: f32,
}

impl ValueRange {
    /// Smallest and largest value of a raw 8-bit skin.
    pub const DIGITS: [f32; 2] = [0.0, 255.0];

    /// Returns the range of all sweeps of `view`; `None` if no value is finite.
    pub fn of(view: &SweepView<'_>) -> Option<Self> {
        let shape = view.shape();
        let taxels = view.dataset().taxel_shape().taxels();
        let mut range: Option<Self> = None;
        for position in 0..view.len() {
            let sweep = view.sweep(position);
            for frame in sweep.chunks_exact(shape.taxels()) {
                let frame = Self::of_frame(&frame[..taxels]);
                range = range.into_iter().chain(frame).reduce(union);
            }
        }
        range
    }

    /// Returns the range of one frame; `None` if no value is finite.
    ///
    /// - `taxels`: `[taxels]`
    pub fn of_frame(taxels: &[f32]) -> Option<Self> {
        let finite = || taxels.iter().copied().filter(|value| value.is_finite());
        let number = finite().count();
        (number > 0).then(|| Self {
            least: finite().fold(f32::INFINITY, f32::min),
            greatest: finite().fold(f32::NEG_INFINITY, f32::max),
            greatest_mean: finite().sum::<f32>() / number as f32,
        })
    }

    /// Returns a warning if the values of `sweeps` are probably in another unit: if their span is less than a fifth of
    /// this range or more than five times as large, or if they are completely outside.
    pub fn caution(&self, sweeps: &SweepView<'_>) -> Option<String> {
        let found = Self::of(sweeps)?;
        let (own, other) = (self.greatest - self.least, found.greatest - found.least);
        let apart = found.greatest < self.least || found.least > self.greatest;
        (apart || other < own / 5.0 || other > own * 5.0).then(|| {
            format!(
                "values from {} to {}, trained on values from {} to {}: is the unit different?",
                found.least, found.greatest, self.least, self.greatest
            )
        })
    }

    /// Returns the smallest and largest value that a skin with such sweeps may show: 0 to 255 if all values are within
    /// it, like those of a raw 8-bit skin, otherwise the range extended by its width on both sides.
    pub fn limits(&self) -> [f32; 2] {
        let [zero, full] = Self::DIGITS;
        if self.least >= zero && self.greatest <= full {
            return Self::DIGITS;
        }
        let width = self.greatest - self.least;
        [
            (self.least - width).max(f32::MIN),
            (self.greatest + width).min(f32::MAX),
        ]
    }
}

/// Returns the union of two ranges.
fn union(a: ValueRange, b: ValueRange) -> ValueRange {
    ValueRange {
        least: a.least.min(b.least),
        greatest: a.greatest.max(b.greatest),
        greatest_mean: a.greatest_mean.max(b.greatest_mean),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Dataset, LabelSet, Samples, SweepRecord, SweepShape};

    #[test]
    fn raw_digits_keep_their_scale_and_other_values_have_room() {
        let range = |values: Vec<f32>| {
            let record = SweepRecord::new(0, 0);
            let shape = SweepShape {
                steps: values.len() / 2,
                rows: 1,
                cols: 2,
            };
            let labels = LabelSet::new(["wood"]).unwrap();
            let samples = Samples::F32(values);
            let dataset = Dataset::new("own", 250.0, shape, labels, vec![record], samples).unwrap();
            ValueRange::of(&SweepView::all(&dataset)).unwrap()
        };
        assert_eq!(range(vec![3.0, 250.0, 0.0, 1.0]).limits(), [0.0, 255.0]);
        let own = range(vec![-2.0, 8.0, 3.0, 5.0]);
        let expected = ValueRange {
            least: -2.0,
            greatest: 8.0,
            greatest_mean: 4.0,
        };
        assert_eq!(own, expected);
        assert_eq!(own.limits(), [-12.0, 18.0]);
        assert_eq!(range(vec![60.0, 1170.0]).limits(), [-1050.0, 2280.0]);
        let [least, greatest] = range(vec![-3e38, 3e38]).limits();
        assert!(least.is_finite() && greatest.is_finite());
    }

    #[test]
    fn values_that_are_no_number_do_not_count() {
        let range = ValueRange::of_frame(&[f32::NAN, 2.0, f32::INFINITY]).unwrap();
        assert_eq!((range.least, range.greatest), (2.0, 2.0));
        assert_eq!(ValueRange::of_frame(&[f32::NAN]), None);
    }

    #[test]
    fn another_unit_is_noticed_and_a_firmer_hand_is_not() {
        let sweeps = |values: [f32; 4]| {
            let labels = LabelSet::new(["wood"]).unwrap();
            let shape = SweepShape {
                steps: 2,
                rows: 1,
                cols: 2,
            };
            let record = SweepRecord::new(0, 0);
            let samples = Samples::F32(values.to_vec());
            Dataset::new("a", 750.0, shape, labels, vec![record], samples).unwrap()
        };
        let known = sweeps([23.0, 100.0, 200.0, 338.0]);
        let known = ValueRange::of(&SweepView::all(&known)).unwrap();
        for (scale, shift, other_unit) in [
            (1.0, 0.0, false),
            (0.5, 0.0, false),
            (1.5, 20.0, false),
            (1.0 / 1023.0, 0.0, true),
            (100.0, 0.0, true),
            (1.0, 1000.0, true),
        ] {
            let values = [23.0, 100.0, 200.0, 338.0].map(|value| value * scale + shift);
            let other = sweeps(values);
            let said = known.caution(&SweepView::all(&other));
            assert_eq!(said.is_some(), other_unit, "{scale} {shift}: {said:?}");
        }
    }
}
