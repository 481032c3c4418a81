//! Wilson's score interval.

/// Returns the 95 % Wilson score interval of a share `mean` of `trials` independent trials; `[0, 1]` without trials.
///
/// Source: E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22, 1927.
///
/// ```
/// let [low, high] = tactnet_plot::wilson(0.97, 1000);
/// assert!((low - 0.9575).abs() < 1e-4 && (high - 0.9789).abs() < 1e-4);
/// ```
pub fn wilson(mean: f64, trials: usize) -> [f64; 2] {
    /// 0.975 quantile of the standard normal distribution.
    const Z: f64 = 1.959_963_984_540_054;
    if trials == 0 {
        return [0.0, 1.0];
    }
    let count = trials as f64;
    let z2 = Z * Z / count;
    let centre = (mean + z2 / 2.0) / (1.0 + z2);
    let half = Z / (1.0 + z2) * (mean * (1.0 - mean) / count + z2 / (4.0 * count)).sqrt();
    [
        (centre - half).clamp(0.0, mean),
        (centre + half).clamp(mean, 1.0),
    ]
}

/// Returns the 95 % Wilson score interval of `successes` in `trials` independent trials; `[0, 1]` without trials.
pub fn wilson_of_counts(successes: usize, trials: usize) -> [f64; 2] {
    wilson(successes as f64 / trials.max(1) as f64, trials)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `statsmodels.stats.proportion.proportion_confint(970, 1000, method="wilson")` (0.14).
    #[test]
    fn intervals_are_those_of_statsmodels() {
        let [low, high] = wilson_of_counts(970, 1000);
        assert!(
            (low - 0.957_498).abs() < 1e-5 && (high - 0.978_908).abs() < 1e-5,
            "{low} {high}"
        );
    }

    #[test]
    fn ends_of_extreme_shares_are_exact() {
        assert_eq!(wilson_of_counts(0, 0), [0.0, 1.0]);
        assert_eq!(wilson_of_counts(0, 10)[0], 0.0);
        assert_eq!(wilson_of_counts(10, 10)[1], 1.0);
    }
}
