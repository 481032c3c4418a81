//! Means over folds, with intervals corrected for overlapping training sets.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// A quantity with one value for each task or fold.
///
/// Intervals and tests use the corrected resampled variance of Nadeau & Bengio (2003), `sd^2 (1/J + n_test/n_train)`,
/// because training sets of different folds overlap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Statistic {
    /// Mean over folds.
    pub mean: f64,
    /// Standard deviation over folds; absent with one fold.
    pub sd: Option<f64>,
    /// 95 % interval of the mean; absent with one fold, and if all folds are equal.
    pub ci95: Option<[f64; 2]>,
    /// One value for each task, in the order of the tasks.
    pub values: Vec<f64>,
}

impl Statistic {
    /// Returns the statistic of one value for each fold.
    ///
    /// - `test_share`: number of test sweeps divided by number of training sweeps
    ///
    /// # Panics
    /// If `values` is empty.
    pub fn of(values: Vec<f64>, test_share: f64) -> Self {
        assert!(!values.is_empty(), "a mean needs at least one fold");
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        if values.len() < 2 {
            return Self {
                mean,
                sd: None,
                ci95: None,
                values,
            };
        }
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (count - 1.0);
        let error = (variance * (1.0 / count + test_share)).sqrt();
        let reach = error * student(count - 1.0).inverse_cdf(0.975);
        Self {
            mean,
            sd: Some(variance.sqrt()),
            ci95: (variance > 0.0).then_some([mean - reach, mean + reach]),
            values,
        }
    }

    /// Returns the statistic of shares, whose interval is clamped to 0 and 1.
    pub fn of_shares(values: Vec<f64>, test_share: f64) -> Self {
        let mut statistic = Self::of(values, test_share);
        if let Some(ends) = &mut statistic.ci95 {
            ends.iter_mut().for_each(|end| *end = end.clamp(0.0, 1.0));
        }
        statistic
    }
}

/// Returns the two-sided p-value for a mean difference of zero, by the corrected resampled t-test. Returns `None` with
/// one fold or without any variance.
///
/// - `differences`: one for each common fold
pub fn resampled_t_test(differences: &[f64], test_share: f64) -> Option<f64> {
    let statistic = Statistic::of(differences.to_vec(), test_share);
    let count = differences.len() as f64;
    let error = statistic.sd? * (1.0 / count + test_share).sqrt();
    if error == 0.0 {
        return None;
    }
    let t = (statistic.mean / error).abs();
    Some((2.0 * (1.0 - student(count - 1.0).cdf(t))).clamp(0.0, 1.0))
}

fn student(freedom: f64) -> StudentsT {
    StudentsT::new(0.0, 1.0, freedom)
        .unwrap_or_else(|error| panic!("{freedom} degrees of freedom: {error}"))
}

/// Returns p-values after Holm's correction (1979), in the given order. Each value is multiplied by the number of
/// values that are not smaller, and is at least the corrected value before it.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut least = 0.0f64;
    for (rank, index) in order.into_iter().enumerate() {
        least = least.max((p[index] * (p.len() - rank) as f64).min(1.0));
        adjusted[index] = least;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values from scipy.stats.t: ppf(0.975, 4) = 2.776445, 2 * sf(2.0, 4) = 0.116117.
    #[test]
    fn intervals_and_tests_use_the_corrected_variance() {
        let statistic = Statistic::of(vec![0.80, 0.82, 0.84, 0.86, 0.88], 0.25);
        let sd = 0.001_f64.sqrt();
        assert!((statistic.mean - 0.84).abs() < 1e-12);
        assert!((statistic.sd.unwrap() - sd).abs() < 1e-12);
        let reach = 2.776_445 * sd * 0.45_f64.sqrt();
        assert!((statistic.ci95.unwrap()[1] - 0.84 - reach).abs() < 1e-6);
        // Differences chosen so that t is 2: mean = 2 sd sqrt(0.45).
        let shift = 2.0 * sd * 0.45_f64.sqrt();
        let differences: Vec<f64> = [-0.04, -0.02, 0.0, 0.02, 0.04]
            .iter()
            .map(|d| d + shift)
            .collect();
        let p = resampled_t_test(&differences, 0.25).unwrap();
        assert!((p - 0.116_117).abs() < 1e-5, "{p}");
        assert_eq!(resampled_t_test(&[0.1], 0.25), None);
        assert_eq!(Statistic::of(vec![0.5], 0.25).ci95, None);
        let equal = Statistic::of_shares(vec![1.0, 1.0], 1.0);
        assert_eq!((equal.sd, equal.ci95), (Some(0.0), None));
    }

    /// Reference: `statsmodels.stats.multitest.multipletests(p, method="holm")` (0.14).
    #[test]
    fn holms_correction_matches_statsmodels() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005, 0.9]);
        for (found, expected) in adjusted.iter().zip([0.04, 0.09, 0.09, 0.025, 0.9]) {
            assert!((found - expected).abs() < 1e-12, "{adjusted:?}");
        }
        assert!(holm(&[]).is_empty());
        assert_eq!(holm(&[0.6, 0.7]), [1.0, 1.0]);
    }
}
