//! Random permutations that do not depend on the versions of dependencies.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Permutes `items` at random; every order is equally likely.
///
/// The algorithm is fixed here: Fisher-Yates from the last item down, with unbiased draws from `u64`. rand's own
/// `shuffle` may draw other numbers after a minor release, but folds must stay the same. The specification of ChaCha8
/// fixes its output.
///
/// ```
/// use tactnet_data::{Seed, shuffle};
/// let mut sweeps = [0, 1, 2, 3, 4, 5, 6, 7];
/// shuffle(&mut sweeps, &mut Seed(7).rng("example"));
/// assert_ne!(sweeps, [0, 1, 2, 3, 4, 5, 6, 7]);
/// ```
pub fn shuffle<T>(items: &mut [T], rng: &mut ChaCha8Rng) {
    for last in (1..items.len()).rev() {
        items.swap(last, below(last as u64 + 1, rng) as usize);
    }
}

/// Returns a number in `0..bound`; draws from the incomplete last part of the `u64` range are rejected.
fn below(bound: u64, rng: &mut ChaCha8Rng) -> u64 {
    let incomplete = (u64::MAX % bound + 1) % bound;
    loop {
        let draw = rng.next_u64();
        if draw <= u64::MAX - incomplete {
            return draw % bound;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Seed;
    use std::collections::BTreeMap;

    #[test]
    fn every_order_is_equally_likely() {
        let mut rng = Seed(1).rng("orders");
        let mut counts = BTreeMap::new();
        for _ in 0..24_000 {
            let mut items = [0, 1, 2, 3];
            shuffle(&mut items, &mut rng);
            *counts.entry(items).or_insert(0i64) += 1;
        }
        assert_eq!(counts.len(), 24);
        // 1000 are expected with a standard deviation of 31; five of those give a false alarm in 1e-5 of all runs.
        assert!(
            counts.values().all(|&n| (n - 1000).abs() < 155),
            "{counts:?}"
        );
    }

    #[test]
    fn bounded_draws_stay_below_the_bound() {
        let mut rng = Seed(2).rng("bounds");
        for bound in [1, 2, 3, 36, 1 << 40, (1 << 63) + 1, u64::MAX] {
            for _ in 0..200 {
                assert!(below(bound, &mut rng) < bound);
            }
        }
    }

    #[test]
    fn orders_never_change_between_versions() {
        let mut items: Vec<usize> = (0..10).collect();
        shuffle(&mut items, &mut Seed(0).rng(("folds", 0, 0)));
        assert_eq!(items, [5, 3, 1, 2, 9, 6, 8, 0, 7, 4]);
    }
}
