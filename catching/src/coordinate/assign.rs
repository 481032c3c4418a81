//! Assignment of balls to arms.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::MAX_BALLS;

/// Index of the ball assigned to each arm.
pub type Assignment = [Option<usize>; ARMS];

/// Returns the assignment with the most catches and, among those, the least cost. `costs[ball][arm]` is `None` if there
/// is no catch. Ties go to the first arm with the first ball.
pub fn assign(costs: &[[Option<f64>; ARMS]; MAX_BALLS]) -> Assignment {
    let mut best: (usize, f64, Assignment) = (0, 0.0, [None; ARMS]);
    for left in [None, Some(0), Some(1)] {
        for right in [None, Some(0), Some(1)] {
            if left.is_some() && left == right {
                continue;
            }
            let assignment: Assignment = [left, right];
            let mut caught = 0;
            let mut total = 0.0;
            let possible = assignment.iter().enumerate().all(|(arm, ball)| match ball {
                None => true,
                Some(ball) => costs[*ball][arm].is_some_and(|cost| {
                    caught += 1;
                    total += cost;
                    true
                }),
            });
            if possible && (caught > best.0 || (caught == best.0 && total < best.1)) {
                best = (caught, total, assignment);
            }
        }
    }
    best.2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_balls_that_can_be_caught_are_caught_whatever_it_costs() {
        // The left arm is better for both balls.
        let costs = [[Some(0.1), Some(0.9)], [Some(0.2), None]];
        assert_eq!(assign(&costs), [Some(1), Some(0)]);
        let costs = [[Some(0.1), Some(0.9)], [Some(0.2), Some(0.3)]];
        assert_eq!(assign(&costs), [Some(0), Some(1)]);
    }

    #[test]
    fn one_ball_goes_to_the_arm_with_the_gentler_catch() {
        let costs = [[Some(0.5), Some(0.4)], [None, None]];
        assert_eq!(assign(&costs), [None, Some(0)]);
        assert_eq!(assign(&[[None, None], [None, None]]), [None, None]);
        assert_eq!(assign(&[[None, None], [Some(-1.0), None]]), [Some(1), None]);
    }

    #[test]
    fn the_order_of_the_balls_changes_nothing() {
        let costs = [[Some(0.5), Some(0.4)], [Some(0.3), Some(0.7)]];
        let swapped = [costs[1], costs[0]];
        let other = assign(&swapped).map(|ball| ball.map(|ball| 1 - ball));
        assert_eq!(assign(&costs), other);
    }
}
