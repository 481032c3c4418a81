//! Area under the ROC curve.

/// Returns the area under the ROC curve: the probability that a random positive scores above a random negative, with
/// ties counting half (Mann & Whitney).
///
/// # Panics
/// If `negatives` or `positives` is empty.
pub(crate) fn auroc(negatives: &[f64], positives: &[f64]) -> f64 {
    assert!(!negatives.is_empty() && !positives.is_empty(), "two kinds");
    let mut all: Vec<(f64, bool)> = negatives.iter().map(|v| (*v, false)).collect();
    all.extend(positives.iter().map(|v| (*v, true)));
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut below, mut wins) = (0.0, 0.0);
    for tie in all.chunk_by(|a, b| a.0 == b.0) {
        let positive = tie.iter().filter(|(_, positive)| *positive).count() as f64;
        let negative = tie.len() as f64 - positive;
        wins += positive * (below + negative / 2.0);
        below += negative;
    }
    wins / (negatives.len() as f64 * positives.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_counts_pairs_that_are_in_order() {
        assert_eq!(auroc(&[0.0, 1.0], &[2.0, 3.0]), 1.0);
        assert_eq!(auroc(&[2.0, 3.0], &[0.0, 1.0]), 0.0);
        assert_eq!(auroc(&[1.0, 1.0], &[1.0]), 0.5);
        // By hand: of the six pairs, 0.1 < 0.4, 0.1 < 0.35, 0.1 < 0.8, 0.35 = 0.35, 0.35 < 0.4, 0.35 < 0.8.
        assert!((auroc(&[0.1, 0.35], &[0.4, 0.35, 0.8]) - 5.5 / 6.0).abs() < 1e-12);
    }
}
