//! Quantiles of the chi-square distribution.

/// Returns the 95 % band of the mean of `number` independent values, each chi-square distributed with `freedom`
/// degrees.
///
/// Uses the approximation of Wilson and Hilferty. Its relative error is at most a sixth at 3 degrees in total, and
/// 0.3 % from 30 on.
pub fn chi_square_band(freedom: f64, number: usize) -> [f64; 2] {
    let all = freedom * number as f64;
    let spread = 2.0 / (9.0 * all);
    [-1.959_963_984_540_054, 1.959_963_984_540_054].map(|z: f64| {
        let root = 1.0 - spread + z * spread.sqrt();
        all * root.max(0.0).powi(3) / number as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scipy.stats.chi2.ppf([0.025, 0.975], n * 3) / n`, SciPy 1.17.
    #[test]
    fn quantiles_are_those_of_scipy() {
        for (number, known, tolerance) in [
            (1, [0.215_795, 9.348_404], 0.17),
            (10, [1.679_077, 4.697_924], 3e-3),
            (1000, [2.850_085, 3.153_703], 1e-4),
        ] {
            for (own, known) in chi_square_band(3.0, number).into_iter().zip(known) {
                let off = (own / known - 1.0).abs();
                assert!(off < tolerance, "{number}: {own}, {known}");
            }
        }
    }
}
