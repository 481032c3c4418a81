//! Catching of the other robot's throws.

use nalgebra::Vector2;
use tactnet_catching::throw::Landing;
use tactnet_catching_world::{Released, TICK_NS, Verdict};

use super::player::Player;
use crate::error::TrialError;
use crate::look_ahead::as_flight;
use crate::series::cause;
use crate::stepped_time::ticks;
use tactnet_catching::CatchSpace;

/// Maximum time after a throw until its verdict, in s.
const LONGEST: f64 = 2.5;
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
    /// Waits until the robot rests, and tries to catch a ball that left the other robot's hand, with `released` in this
    /// robot's frame.
    ///
    /// - `target`: target of the throw, in m
    ///
    /// # Errors
    /// A robot that does not get to rest.
    pub fn catch(
        &mut self,
        released: &Released,
        target: &[f64; 3],
        oracle: &CatchSpace,
    ) -> Result<Catch, TrialError> {
        self.rest()?;
        self.stack.forget();
        let before = self.world.verdicts().len();
        // The ticks of both worlds may have an offset.
        let ago = (TICK_NS - released.at_ns % TICK_NS) as f64 * 1e-9;
        self.world.launch(released, ago);
        for _ in 0..ticks(LONGEST) {
            self.tick();
            if self.world.verdicts().len() > before {
                break;
            }
        }
        let verdict = self.world.verdicts().get(before).copied();
        Ok(self.judge(verdict, released, target, oracle))
    }

    fn judge(
        &self,
        verdict: Option<Verdict>,
        released: &Released,
        target: &[f64; 3],
        oracle: &CatchSpace,
    ) -> Catch {
        let flight = self.world.flight_of(released);
        let cameras = &self.config.robot.description().cameras;
        let reaction = self.config.timing.reaction(cameras.rate);
        let said = &self.stack.said;
        let planned = !self.stack.chosen.is_empty();
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
                .arms_of(
                    flight.iter().map(as_flight),
                    reaction,
                    &self.config.robot.waiting(),
                )
                .contains(&true),
            beside,
        }
    }
}
