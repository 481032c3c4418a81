//! Origins of the balls that were caught.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{ArmPath, BallPredictions};

/// Number of balls whose first positions are kept.
const BALLS: usize = 8;

/// First positions of balls, and the ball that each arm reached for.
#[derive(Debug, Clone)]
pub(super) struct Origins {
    existence: f32,
    /// Number and first position of each ball; oldest first.
    first: Vec<(u64, [f64; 3])>,
    caught: [Option<u64>; ARMS],
}

impl Origins {
    pub fn new(existence: f32) -> Self {
        Self {
            existence,
            first: Vec::with_capacity(BALLS + 1),
            caught: [None; ARMS],
        }
    }

    pub fn seen(&mut self, predictions: &BallPredictions) {
        for ball in predictions.valid() {
            let known = self.first.iter().any(|(number, _)| *number == ball.ball);
            let place = ball.p.iter().all(|x| x.is_finite());
            if known || !place || ball.existence < self.existence {
                continue;
            }
            self.first.push((ball.ball, ball.p));
            if self.first.len() > BALLS {
                self.first.remove(0);
            }
        }
    }

    pub fn reached(&mut self, path: &ArmPath) {
        if let Some(ball) = self.caught.get_mut(path.arm as usize) {
            *ball = Some(path.ball);
        }
    }

    /// Returns the first position of the last ball that an arm reached for.
    pub fn of(&self, arm: usize) -> Option<[f64; 3]> {
        let ball = (*self.caught.get(arm)?)?;
        let first = self.first.iter().find(|(number, _)| *number == ball);
        first.map(|(_, place)| *place)
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::BallPrediction;

    use super::*;

    #[test]
    fn a_ball_comes_from_where_it_was_first_seen_and_the_arm_that_reached_for_it_has_it() {
        let mut origins = Origins::new(0.95);
        let see = |origins: &mut Origins, ball: u64, existence: f32, x: f64| {
            let mut seen = BallPredictions::zeroed();
            seen.count = 1;
            seen.balls[0] = BallPrediction {
                ball,
                existence,
                p: [x, 0.1, 1.5],
                ..BallPrediction::zeroed()
            };
            origins.seen(&seen);
        };
        see(&mut origins, 3, 0.5, 5.0);
        see(&mut origins, 3, 0.99, 4.8);
        see(&mut origins, 3, 0.99, 4.5);
        let reach = |ball: u64| ArmPath {
            arm: 1,
            ball,
            ..ArmPath::zeroed()
        };
        assert_eq!(origins.of(1), None);
        origins.reached(&reach(3));
        assert_eq!(origins.of(1), Some([4.8, 0.1, 1.5]));
        assert_eq!((origins.of(0), origins.of(2)), (None, None));
        for ball in 10..10 + BALLS as u64 {
            see(&mut origins, ball, 0.99, f64::NAN);
            see(&mut origins, ball, 0.99, 4.0);
        }
        assert_eq!(origins.of(1), None, "forgotten");
        assert_eq!(origins.first.len(), BALLS);
    }
}
