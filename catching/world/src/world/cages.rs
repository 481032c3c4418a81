//! The second judge at work: copies of balls among the fingers of both hands.

use nalgebra::Vector3;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::MAX_BALLS;

use super::{BALL_STEPS, Phase, TICK_NS, World};
use crate::ball::BALL_STEP;
use crate::caging::{Approach, Cage, Copied, NEAR};
use crate::fingers::FINGERS;
use crate::judge::HandDuring;
use crate::robot::FrameMotion;

/// Fingers of a hand and the balls near it, in the catch frame, in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grasp {
    /// Base, both joints and tip of each finger.
    pub fingers: [[Vector3<f64>; 4]; FINGERS],
    /// Balls among the fingers, the earliest first.
    pub balls: [Option<Vector3<f64>>; MAX_BALLS],
}

impl World {
    /// Returns the verdict of the second judge on a ball: if real fingers would have caged it. `None` while it is open,
    /// or if no ball has that number.
    pub fn cage(&self, ball: u64) -> Option<Cage> {
        let ball = self.thrown.get(usize::try_from(ball).ok()?)?;
        match ball.approach {
            Approach::Ended(cage) => Some(cage),
            Approach::Far if matches!(ball.phase, Phase::Missed | Phase::Gone) => {
                Some(Cage::Untouched)
            }
            Approach::Far | Approach::Near(_) => None,
        }
    }

    /// Returns the fingers of a hand and the balls among them.
    pub fn grasp(&self, arm: usize) -> Grasp {
        let (hand, fingers) = (&self.robot.frames.hands[arm], &self.fingers[arm]);
        let mut near = self.thrown.iter().filter_map(|ball| match ball.approach {
            Approach::Near(copy) => Some(copy.state.position - hand.position),
            _ => None,
        });
        Grasp {
            fingers: std::array::from_fn(|finger| {
                let chain = self.basket.chain(finger, fingers.angles[finger]);
                chain.map(|node| node.point)
            }),
            balls: std::array::from_fn(|_| Some(hand.rotation.transpose() * near.next()?)),
        }
    }

    /// Moves fingers and the balls among them through a tick.
    pub(super) fn touch(&mut self, during: &[HandDuring; ARMS]) {
        let mut any = false;
        for ball in &mut self.thrown {
            let to = |hand: &HandDuring| ball.state.position - hand.frames[0].position;
            if matches!((ball.approach, ball.phase), (Approach::Far, Phase::Flying))
                && during.iter().any(|hand| to(hand).norm() < NEAR)
            {
                let copy = Copied::new(ball.state, &ball.air, self.config.ball.mass);
                ball.approach = Approach::Near(copy);
            }
            any |= matches!(ball.approach, Approach::Near(_));
        }
        let lead_ns = (self.basket.config.lead * 1e9) as i64;
        let mut hands = during.each_ref().map(|hand| hand.frames[1]);
        for step in 1..=BALL_STEPS {
            let part = step as f64 / BALL_STEPS as f64;
            let now_ns = self.time_ns + (part * TICK_NS as f64) as u64;
            for (arm, fingers) in self.fingers.iter_mut().enumerate() {
                let starts = during[arm].closes_ns;
                let starts = starts.map(|closes| closes.saturating_add_signed(-lead_ns));
                let kept = fingers.closing && any;
                fingers.closing = kept || starts.is_some_and(|starts| starts <= now_ns);
                self.basket.drive(fingers, BALL_STEP);
                hands[arm] = FrameMotion::between(&during[arm].frames, part);
            }
            for ball in &mut self.thrown {
                if let Approach::Near(copy) = &mut ball.approach {
                    copy.step(
                        &ball.air,
                        BALL_STEP,
                        &self.basket,
                        &hands,
                        &mut self.fingers,
                    );
                }
            }
            for fingers in &mut self.fingers {
                self.basket.turn(fingers, BALL_STEP);
            }
        }
        for ball in &mut self.thrown {
            if let Approach::Near(copy) = &mut ball.approach
                && let Some(cage) = copy.judge(TICK_NS, &self.basket, &hands, &self.fingers)
            {
                ball.approach = Approach::Ended(cage);
            }
        }
    }
}
