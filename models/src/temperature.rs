//! Temperature scaling, which calibrates scores to probabilities (Guo et al., 2017).

/// Returns the inverse temperature that maximises the likelihood of the labels under `softmax(inverse * scores)`.
///
/// - `scores`: `[sweeps][materials]`, of held-out sweeps
/// - `labels`: `[sweeps]`
///
/// As in Platt scaling, the targets are smoothed: for `n` sweeps the label has weight `(n + 1) / (n + 2)`, and the other materials share
/// the rest. So an optimum exists even if all sweeps are classified correctly. The objective is convex in the inverse temperature;
/// bisection finds the root of its slope within `1e-4 ..= 1e4`.
pub fn fit_inverse_temperature(scores: &[Vec<f64>], labels: &[usize]) -> f64 {
    let certain = (labels.len() + 1) as f64 / (labels.len() + 2) as f64;
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
                let others = row.iter().sum::<f64>() - row[*label];
                let rest = (1.0 - certain) / (row.len() - 1).max(1) as f64;
                weighted / weight - certain * row[*label] - rest * others
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
        // With scores 1 and 0, softmax(b * scores) is correct with probability 1 / (1 + exp(-b)). Three of four labels are correct, each with
        // weight 5/6: 3/4 * 5/6 + 1/4 * 1/6 = 2/3.
        let scores = vec![vec![1.0, 0.0]; 4];
        let found = fit_inverse_temperature(&scores, &[0, 0, 0, 1]);
        assert!((found - 2.0_f64.ln()).abs() < 1e-9, "{found}");
    }

    #[test]
    fn scores_that_are_always_right_are_not_taken_for_certain() {
        let found = fit_inverse_temperature(&vec![vec![1.0, 0.0]; 8], &[0; 8]);
        assert!((found - 9.0_f64.ln()).abs() < 1e-9, "{found}");
    }
}
