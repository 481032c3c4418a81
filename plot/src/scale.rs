//! Scales of axes.

use std::ops::RangeInclusive;

/// Mapping of values to positions on an axis.
#[derive(Debug, Clone, PartialEq)]
pub enum Scale {
    /// Equal differences have equal lengths.
    Linear(RangeInclusive<f64>),
    /// Equal ratios have equal lengths; both ends are above 0.
    Logarithmic(RangeInclusive<f64>),
}

impl Scale {
    /// Returns the position of `value` as a share of the length: 0 at the lower end, 1 at the upper end, outside [0, 1]
    /// beyond them.
    ///
    /// The result is not finite for NaN, and on a logarithmic scale for values that are not above 0.
    pub fn share(&self, value: f64) -> f64 {
        match self {
            Self::Linear(range) => share_of(value, *range.start(), *range.end()),
            Self::Logarithmic(range) => share_of(value.ln(), range.start().ln(), range.end().ln()),
        }
    }
}

/// A range of zero width gives 0 for its only value.
fn share_of(value: f64, low: f64, high: f64) -> f64 {
    (value - low) / (high - low).max(f64::MIN_POSITIVE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_values_lie_in_proportion() {
        let scale = Scale::Linear(-1.0..=3.0);
        let shares = [-1.0, 0.0, 3.0, 5.0].map(|value| scale.share(value));
        assert_eq!(shares, [0.0, 0.25, 1.0, 1.5]);
    }

    #[test]
    fn equal_ratios_are_equally_far_apart() {
        let scale = Scale::Logarithmic(1.0..=1000.0);
        for (value, share) in [(1.0, 0.0), (10.0, 1.0 / 3.0), (1000.0, 1.0)] {
            // Logarithms are rounded.
            assert!((scale.share(value) - share).abs() < 1e-12, "{value}");
        }
    }

    #[test]
    fn what_has_no_logarithm_has_no_finite_place() {
        let scale = Scale::Logarithmic(1.0..=10.0);
        assert!(
            [0.0, -2.0, f64::NAN]
                .iter()
                .all(|value| !scale.share(*value).is_finite())
        );
    }

    #[test]
    fn a_range_without_width_has_a_place_for_its_value() {
        assert_eq!(Scale::Linear(2.0..=2.0).share(2.0), 0.0);
    }
}
