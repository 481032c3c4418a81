//! Temperature scaling: turns scores into probabilities that mean what they say (Guo et al., 2017).

/// The inverse temperature that makes `softmax(inverse * scores)` most likely for the true labels.
///
/// - `scores`: `[sweeps][materials]`, of sweeps that nothing was fitted to
/// - `labels`: `[sweeps]`
///
/// The negative log-likelihood is convex in the inverse temperature, so its slope is bisected; without an optimum inside
/// `1e-4 ..= 1e4` (every sweep right, or none) the nearer end is returned.
pub fn fit_inverse_temperature(scores: &[Vec<f64>], labels: &[usize]) -> f64 {
    let slope = |inverse: f64| -> f64 {
        let sweeps = scores.iter().zip(labels);
        sweeps
            .map(|(row, label)| {
                let largest = row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let (mut weight, mut weighted) = (0.0, 0.0);
                for score in row {
                    let exp = (inverse * (score - largest)).exp();
                    weight += exp;
                    weighted += exp * score;
                }
                weighted / weight - row[*label]
            })
            .sum()
    };
    let (mut low, mut high) = (1e-4_f64.ln(), 1e4_f64.ln());
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if slope(middle.exp()) > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    f64::midpoint(low, high).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_scores_give_the_odds() {
        // With scores 1 and 0, softmax(b * scores) is right with probability 1 / (1 + exp(-b)): three of four.
        let scores = vec![vec![1.0, 0.0]; 4];
        let found = fit_inverse_temperature(&scores, &[0, 0, 0, 1]);
        assert!((found - 3.0_f64.ln()).abs() < 1e-9, "{found}");
    }

    #[test]
    fn scores_that_are_always_right_stay_finite() {
        let found = fit_inverse_temperature(&[vec![1.0, 0.0]], &[0]);
        assert!((found - 1e4).abs() < 1.0, "{found}");
    }
}
