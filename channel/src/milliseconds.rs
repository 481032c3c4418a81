//! Percentiles of durations.

use serde::Serialize;

use crate::percentile;

/// Percentiles of durations, in ms.
///
/// ```
/// use tactnet_channel::Milliseconds;
///
/// let times = Milliseconds::of(&[3.0, 1.0, 2.0]).unwrap();
/// assert_eq!((times.count, times.p50, times.max), (3, 2.0, 3.0));
/// assert_eq!(Milliseconds::of(&[]), None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Milliseconds {
    /// Number of durations.
    pub count: usize,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// 99.9th percentile.
    pub p999: f64,
    /// Maximum.
    pub max: f64,
}

impl Milliseconds {
    /// Returns the percentiles of `values`, or `None` if there are none.
    pub fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share| percentile(&sorted, share);
        Some(Self {
            count: sorted.len(),
            p50: at(0.5)?,
            p99: at(0.99)?,
            p999: at(0.999)?,
            max: at(1.0)?,
        })
    }
}
