//! Median, 99th percentile and maximum.

use serde::Serialize;

/// Quantiles of many values.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Maximum.
    pub max: f64,
}

impl Quantiles {
    /// Returns the quantiles of values, or `None` for none.
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self {
            max: *values.last()?,
            p50: quantile(&values, 0.5),
            p99: quantile(&values, 0.99),
        })
    }
}

/// Returns the smallest of ascending values that a share is not above.
///
/// # Panics
/// No values.
pub fn quantile(sorted: &[f64], share: f64) -> f64 {
    let place = (share * sorted.len() as f64).ceil() as usize;
    sorted[place.clamp(1, sorted.len()) - 1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_a_share_is_not_above() {
        let of = |n: i32| Quantiles::of((1..=n).rev().map(f64::from).collect()).unwrap();
        let (p50, p99, max) = (50.0, 99.0, 100.0);
        assert_eq!(of(100), Quantiles { p50, p99, max });
        assert_eq!(of(1).p99, 1.0);
        assert_eq!(Quantiles::of(Vec::new()), None);
    }
}
