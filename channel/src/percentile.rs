//! Percentiles of measured values.

/// Returns the smallest value that at least a `share` of all values does not exceed (nearest rank). `None` for no
/// values.
///
/// - `sorted`: ascending
/// - `share`: 0 to 1
///
/// ```
/// assert_eq!(tactnet_channel::percentile(&[1, 2, 3, 4], 0.5), Some(2));
/// ```
pub fn percentile<T: Copy>(sorted: &[T], share: f64) -> Option<T> {
    let rank = (sorted.len() as f64 * share).ceil() as usize;
    sorted.get(rank.max(1) - 1).copied()
}

#[cfg(test)]
mod tests {
    use super::percentile;

    #[test]
    fn ranks_are_those_of_numpy_inverted_cdf() {
        // numpy.percentile(range(1, 11), 100 * share, method="inverted_cdf")
        let values: Vec<i32> = (1..=10).collect();
        for (share, expected) in [
            (0.0, 1),
            (0.05, 1),
            (0.5, 5),
            (0.51, 6),
            (0.99, 10),
            (1.0, 10),
        ] {
            assert_eq!(percentile(&values, share), Some(expected), "{share}");
        }
        assert_eq!(percentile(&[3], 0.5), Some(3));
        assert_eq!(percentile::<f64>(&[], 0.5), None);
    }
}
