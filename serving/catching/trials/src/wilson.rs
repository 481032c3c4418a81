//! Intervals of shares.

/// Returns Wilson's 95 % interval of a share; 0 to 1 of none.
pub fn wilson(successes: usize, of: usize) -> [f64; 2] {
    if of == 0 {
        return [0.0, 1.0];
    }
    let (n, z) = (of as f64, 1.959_963_984_540_054);
    let p = successes as f64 / n;
    let middle = p + z * z / (2.0 * n);
    let reach = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let all = 1.0 + z * z / n;
    // At the ends they are exact, whatever is rounded.
    [
        if successes == 0 {
            0.0
        } else {
            (middle - reach) / all
        },
        if successes == of {
            1.0
        } else {
            (middle + reach) / all
        },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `statsmodels.stats.proportion.proportion_confint(970, 1000, method="wilson")` (0.14).
    #[test]
    fn intervals_are_those_of_statsmodels() {
        let [low, high] = wilson(970, 1000);
        assert!(
            (low - 0.957_498).abs() < 1e-5 && (high - 0.978_908).abs() < 1e-5,
            "{low} {high}"
        );
        assert_eq!(wilson(0, 0), [0.0, 1.0]);
        assert!(wilson(0, 10)[0] == 0.0 && wilson(10, 10)[1] == 1.0);
    }
}
