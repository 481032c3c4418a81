//! Throws of two balls, counted as in stepped time. A throw counts once. It is in the catch space if each ball has an
//! arm that can catch it, and caught if both balls are.

use serde::Serialize;
use tactnet_catching_packets::packets::CatchOutcome;
use tactnet_plot::wilson_of_counts;

/// Statistics of throws of two balls.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PairReport {
    /// Number of throws with two judged balls.
    pub thrown: usize,
    /// Number of throws in the catch space: each ball can be caught by a separate arm.
    pub catchable: usize,
    /// Number of caught throws in the catch space.
    pub caught: usize,
    /// Catch rate in the catch space; `null` without such throws.
    pub rate: Option<f64>,
    /// Lower end of the 95 % Wilson interval of the rate.
    pub ci95_low: f64,
    /// Upper end of the interval.
    pub ci95_high: f64,
    /// Number of caught throws, in the catch space or not.
    pub caught_of_all: usize,
}

impl PairReport {
    /// Computes the statistics.
    ///
    /// - `outcomes`: outcomes in temporal order; returns `None` for throws of one ball
    pub(crate) fn of(outcomes: &[CatchOutcome]) -> Option<Self> {
        let same_throw = |a: &CatchOutcome, b: &CatchOutcome| a.throw == b.throw;
        let throws = outcomes.chunk_by(same_throw);
        let pairs: Vec<&[CatchOutcome]> = throws.filter(|balls| balls.len() == 2).collect();
        let is_caught = |balls: &&&[CatchOutcome]| balls.iter().all(|outcome| outcome.caught == 1);
        let catchable: Vec<_> = pairs.iter().filter(|balls| have_arms(balls)).collect();
        let caught = catchable.iter().copied().filter(is_caught).count();
        let [ci95_low, ci95_high] = wilson_of_counts(caught, catchable.len());
        (!pairs.is_empty()).then(|| Self {
            thrown: pairs.len(),
            catchable: catchable.len(),
            caught,
            rate: (!catchable.is_empty()).then(|| caught as f64 / catchable.len() as f64),
            ci95_low,
            ci95_high,
            caught_of_all: pairs.iter().filter(is_caught).count(),
        })
    }
}

/// Returns true if each ball can be caught by a separate arm. Arms are bits.
fn have_arms(balls: &[CatchOutcome]) -> bool {
    let [a, b] = balls else {
        return false;
    };
    a.arms != 0 && b.arms != 0 && (a.arms | b.arms) == 3
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
        assert_eq!(
            (
                pairs.thrown,
                pairs.catchable,
                pairs.caught,
                pairs.caught_of_all
            ),
            (4, 2, 1, 2)
        );
        assert_eq!(pairs.rate, Some(0.5));
        assert_eq!(PairReport::of(&outcomes[8..]), None);
    }
}
