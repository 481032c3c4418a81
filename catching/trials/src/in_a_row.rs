//! Balls one after the other, without a return to the waiting pose (thesis, figure 3.10).

use tactnet_catching::CatchSpace;
use tactnet_catching::coordinate::NextPose;
use tactnet_catching::pose::TORSO_RESTS;
use tactnet_catching_packets::ARMS;

use crate::error::TrialError;
use crate::stepped_time::{ticks, world_seed};
use crate::throw::{LONGEST, LONGEST_BACK, SimulatedThrow, Watching};
use crate::throw_config::ThrowConfig;
use crate::throw_outcome::ThrowOutcome;
use crate::trace::Trace;

pub(crate) type RowThrow = (ThrowOutcome, Trace);

impl ThrowConfig {
    /// Simulates row `number` of a series: `length` throws in one world. The robot waits for each in the pose of the
    /// last catch, until its torso is at rest, and its hands are emptied.
    ///
    /// # Errors
    /// Invalid settings, or a robot that does not get to rest.
    pub(crate) fn row(
        &self,
        seed: u64,
        number: u64,
        length: u64,
        oracle: &CatchSpace,
    ) -> Result<Vec<RowThrow>, TrialError> {
        let config = Self {
            next: NextPose::LastCatch,
            still: TORSO_RESTS,
            ..self.clone()
        };
        let seed = world_seed(seed, number);
        let watching = Watching::default();
        let mut throw = SimulatedThrow::new(&config, seed, watching)?;
        let first = number * length;
        (first..first + length)
            .map(|number| throw.next_of_row(number, oracle))
            .collect()
    }
}

impl SimulatedThrow<'_> {
    /// Waits until the robot is ready, and throws.
    fn next_of_row(&mut self, number: u64, oracle: &CatchSpace) -> Result<RowThrow, TrialError> {
        let mut waiting = 0..ticks(LONGEST_BACK);
        while !self.stack.waits_at_rest(self.world.time_ns()) {
            waiting.next().ok_or(TrialError::NotBack)?;
            self.tick();
        }
        (0..ARMS).for_each(|arm| self.world.take(arm));
        if let Some(joints) = self.stack.perception.joints() {
            self.ready = self.config.corrections().joints(joints).q;
        }
        let (no_plans, stops) = (self.stack.no_plans(), self.stack.safety().brakes());
        self.stack.forget();
        self.watching.trace = Some(Trace::default());
        self.throw_now();
        for _ in 0..ticks(LONGEST) {
            self.tick();
            if self.is_judged() {
                break;
            }
        }
        let mut outcome = ThrowOutcome {
            number,
            balls: self.outcomes(oracle),
            no_plans: self.stack.no_plans() - no_plans,
            obstacles: None,
            stops: self.stack.safety().brakes() - stops,
            braked: None,
        };
        let trace = self.end_trace().unwrap_or_default();
        self.judge_fingers(&mut outcome.balls);
        Ok((outcome, trace))
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching::Robot;
    use tactnet_catching_packets::joint;
    use tactnet_catching_world::WorldConfig;

    use super::*;

    #[test]
    fn a_robot_waits_for_each_ball_in_the_pose_of_the_last_catch() {
        let robot = Robot::nominal();
        let oracle = CatchSpace::new(&robot, true);
        let config = ThrowConfig::new(robot, WorldConfig::default());
        let row = config.row(11, 0, 3, &oracle).unwrap();
        let apart = |a: &[f64], b: &[f64]| {
            let pairs = joint::ARM
                .into_iter()
                .flatten()
                .map(|i| (a[i] - b[i]).abs());
            pairs.fold(0.0, f64::max)
        };
        for pair in row.windows(2) {
            let [(outcome, before), (_, after)] = pair else {
                unreachable!("two of a row")
            };
            assert!(outcome.balls[0].planned);
            let (end, begin) = (&before.ticks.last().unwrap().angles, &after.ticks[0].angles);
            // The drives lag behind the command when the ball crosses the hand.
            assert!(apart(end, begin) < 0.05, "{}", apart(end, begin));
            assert!(apart(begin, &config.robot.waiting()) > 0.2);
        }
        assert_eq!(row[2].0.number, 2);
    }
}
