//! Ranks of models on one data set.

use crate::phrases;

/// Returns the rank of each accuracy, 1 for the highest. Equal accuracies share the mean of their ranks; absent ones, of models that a data
/// set does not allow, share the last ranks.
pub(crate) fn ranks(accuracies: &[Option<f64>]) -> Vec<f64> {
    // Means that only differ by rounding are equal.
    let keys: Vec<Option<i64>> = accuracies
        .iter()
        .map(|accuracy| accuracy.map(phrases::rank))
        .collect();
    let rank = |own: &Option<i64>| {
        let better = keys.iter().filter(|other| *other > own).count() as f64;
        let equal = keys.iter().filter(|other| *other == own).count() as f64;
        better + (equal + 1.0) / 2.0
    };
    keys.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use tactnet_data::Seed;

    use super::*;

    #[test]
    fn equal_accuracies_share_ranks_and_absent_ones_come_last() {
        let found = ranks(&[Some(0.9), None, Some(0.8), Some(0.9), None]);
        assert_eq!(found, [1.5, 4.5, 3.0, 1.5, 4.5]);
    }

    #[test]
    fn ranks_follow_the_accuracies_and_have_a_fixed_sum() {
        let mut rng = Seed(4).rng("ranks");
        for _ in 0..200 {
            let models = rng.random_range(1..10);
            // Few values, so that ties are frequent; a fifth of the models is left out.
            let accuracies: Vec<Option<f64>> = (0..models)
                .map(|_| {
                    let tenths: u8 = rng.random_range(0..10);
                    (tenths > 1).then(|| f64::from(tenths) / 10.0)
                })
                .collect();
            let found = ranks(&accuracies);
            let sum: f64 = found.iter().sum();
            assert_eq!(sum, (models * (models + 1)) as f64 / 2.0, "{accuracies:?}");
            for (a, rank_a) in accuracies.iter().zip(&found) {
                for (b, rank_b) in accuracies.iter().zip(&found) {
                    assert_eq!(a > b, rank_a < rank_b, "{accuracies:?}: {found:?}");
                }
            }
        }
    }
}
