//! Catching of the other robot's throws, with the same parts as in series of throws.

use nalgebra::Vector2;
use tactnet_catching::throw::Landing;
use tactnet_catching_packets::packets::ControllerMode;
use tactnet_catching_world::{Released, TICK_NS, Verdict};

use super::player::Player;
use crate::error::TrialError;
use crate::look_ahead::as_flight;
use crate::series::cause;
use crate::stepped_stack::SteppedStack;
use crate::stepped_time::ticks;
use tactnet_catching::CatchSpace;

/// Standstill before the throw in s, in which the pose estimator determines the bias of the inertial unit.
const REST: f64 = 1.0;
/// Maximum time after a throw until its verdict, in s.
const LONGEST: f64 = 2.5;
/// Time in which the robot comes to rest after a catch, in s.
const STANDS: f64 = 0.3;
/// Minimum number of pictures for a reliable landing point.
const SEEN: u32 = 6;

/// Result of a catch attempt.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Catch {
    /// Arm that caught the ball.
    pub arm: Option<usize>,
    /// Cause of a miss; meaningless for a catch.
    pub cause: &'static str,
    /// True if the ball was in the catch space.
    pub in_catch_space: bool,
    /// Offset of the landing point from the target according to the tracker, in m, in the robot's frame.
    pub beside: Option<Vector2<f64>>,
}

impl Player {
    /// Waits for a ball that left the other robot's hand, with `released` in this robot's frame, and tries to catch
    /// it.
    ///
    /// - `target`: target of the throw, in m
    pub fn catch(
        &mut self,
        released: &Released,
        target: &[f64; 3],
        oracle: &CatchSpace,
    ) -> Result<Catch, TrialError> {
        let mut stack = SteppedStack::new(&self.config, self.config.ready(), None, 0)?;
        let before = self.world.verdicts().len();
        let mut left = ticks(LONGEST);
        let mut tick = 0;
        // A robot that misses is on its way back, and must come to rest.
        let moves = |stack: &SteppedStack| {
            let mode = stack.controller.mode();
            matches!(mode, ControllerMode::GoingBack | ControllerMode::Braking)
        };
        while left > 0 || moves(&stack) {
            left = left.saturating_sub(1);
            let now_ns = self.world.time_ns();
            if tick == ticks(REST) {
                // The ticks of both worlds may have an offset.
                let ago = (TICK_NS - released.at_ns % TICK_NS) as f64 * 1e-9;
                self.world.launch(released, ago);
            } else if tick < ticks(REST) {
                left = ticks(LONGEST);
            }
            let command = stack.step(now_ns, None);
            let sensed = self.step((command.q, command.dq), stack.hands());
            stack.sense(&sensed, &self.world.truth());
            if self.world.verdicts().len() > before {
                left = left.min(ticks(STANDS));
            }
            tick += 1;
        }
        let verdict = self.world.verdicts().get(before).copied();
        Ok(self.judge(verdict, &stack, released, target, oracle))
    }

    fn judge(
        &self,
        verdict: Option<Verdict>,
        stack: &SteppedStack,
        released: &Released,
        target: &[f64; 3],
        oracle: &CatchSpace,
    ) -> Catch {
        let flight = self.world.flight_of(released);
        let cameras = &self.config.robot.description().cameras;
        let reaction = self.config.timing.reaction(cameras.rate);
        let said = &stack.said;
        let planned = !stack.chosen.is_empty();
        // The last predictions are of a ball that is already below that height.
        let beside = said.iter().rev().find_map(|said| {
            let ball = Some(&said.prediction).filter(|ball| ball.frames >= SEEN)?;
            let landing = Landing::of(&ball.p.into(), &ball.v.into(), ball.k, target[2])?;
            Some(landing.p.xy() - Vector2::new(target[0], target[1]))
        });
        Catch {
            arm: verdict
                .filter(Verdict::caught)
                .and_then(|verdict| Some(verdict.crossing?.arm)),
            cause: cause(verdict.as_ref(), !said.is_empty(), planned),
            in_catch_space: oracle
                .arms_of(flight.iter().map(as_flight), reaction, &self.config.ready())
                .contains(&true),
            beside,
        }
    }
}
