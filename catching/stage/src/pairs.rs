//! Catches of balls, and of throws of two balls, counted as in stepped time. Such a throw counts once. It is in the catch
//! space if each ball has an arm that can catch it, and caught if both balls are.

use serde::Serialize;
use tactnet_catching_packets::packets::CatchOutcome;
use tactnet_plot::wilson_of_counts;

/// Catches of balls or of throws.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CatchCounts {
    /// Number in the catch space.
    pub catchable: usize,
    /// Number of caught ones in the catch space.
    pub caught: usize,
    /// Catch rate in the catch space; `null` if none is.
    pub rate: Option<f64>,
    /// Lower end of the 95 % Wilson interval of the rate.
    pub ci95_low: f64,
    /// Upper end of the interval.
    pub ci95_high: f64,
    /// Number of caught ones, in the catch space or not.
    pub caught_of_all: usize,
}

impl CatchCounts {
    /// Computes the statistics.
    ///
    /// - `all`: for each, true if it was in the catch space, and true if it was caught
    pub(crate) fn of(all: &[[bool; 2]]) -> Self {
        let count = |wanted: fn(&[bool; 2]) -> bool| all.iter().filter(|one| wanted(one)).count();
        let (catchable, caught) = (count(|[space, _]| *space), count(|both| *both == [true; 2]));
        let [ci95_low, ci95_high] = wilson_of_counts(caught, catchable);
        Self {
            catchable,
            caught,
            rate: (catchable > 0).then(|| caught as f64 / catchable as f64),
            ci95_low,
            ci95_high,
            caught_of_all: count(|[_, caught]| *caught),
        }
    }
}

/// Statistics of throws of two balls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairReport {
    /// Number of throws with two judged balls.
    pub thrown: usize,
    /// Catches. A throw is in the catch space if each ball can be caught by a separate arm.
    #[serde(flatten)]
    pub counts: CatchCounts,
}

impl PairReport {
    /// Computes the statistics.
    ///
    /// - `outcomes`: outcomes in temporal order; returns `None` for throws of one ball
    pub(crate) fn of(outcomes: &[CatchOutcome]) -> Option<Self> {
        let throws = outcomes.chunk_by(|a, b| a.throw == b.throw);
        let pairs = throws.filter_map(|balls| {
            let [a, b] = balls else { return None };
            // Arms are bits.
            let have_arms = a.arms != 0 && b.arms != 0 && (a.arms | b.arms) == 3;
            Some([have_arms, a.caught == 1 && b.caught == 1])
        });
        let pairs: Vec<_> = pairs.collect();
        (!pairs.is_empty()).then(|| Self {
            thrown: pairs.len(),
            counts: CatchCounts::of(&pairs),
        })
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn pairs_are_of_the_catch_space_where_each_ball_has_an_arm() {
        let outcome = |throw, arms, caught| CatchOutcome {
            throw,
            arms,
            caught,
            ..CatchOutcome::zeroed()
        };
        let outcomes = [
            outcome(1, 3, 1),
            outcome(1, 1, 1),
            // The same arm for both balls.
            outcome(2, 2, 1),
            outcome(2, 2, 1),
            outcome(3, 1, 1),
            outcome(3, 2, 0),
            // Out of reach.
            outcome(4, 0, 0),
            outcome(4, 3, 1),
            // The run ended before the second ball was judged.
            outcome(5, 3, 1),
        ];
        let pairs = PairReport::of(&outcomes).unwrap();
        let counts = pairs.counts;
        assert_eq!((pairs.thrown, counts.catchable), (4, 2));
        assert_eq!((counts.caught, counts.caught_of_all), (1, 2));
        assert_eq!(counts.rate, Some(0.5));
        assert_eq!(PairReport::of(&outcomes[8..]), None);
    }
}
