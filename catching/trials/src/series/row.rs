//! Series of rows: balls one after the other, without a return to the waiting pose (thesis, figure 3.10).

use std::fmt::Write;

use tactnet_catching::CatchSpace;
use tactnet_catching::coordinate::NextPose;
use tactnet_catching::pose::TORSO_RESTS;
use tactnet_catching_packets::ARMS;
use tactnet_plot::stand_alone;

use super::{Series, SeriesReport};
use crate::error::TrialError;
use crate::parallel::on_all_cores;
use crate::picture::{HEIGHT, WIDTH, content};
use crate::stepped_time::{ticks, world_seed};
use crate::throw::{LONGEST, LONGEST_BACK, SimulatedThrow, Watching};
use crate::throw_config::ThrowConfig;
use crate::throw_outcome::ThrowOutcome;
use crate::trace::Trace;

/// Number of drawn catches side by side.
const COLUMNS: usize = 2;

type RowThrow = (ThrowOutcome, Trace);

impl Series {
    /// Runs whole rows of `length` throws, at least as many throws as [`Series::throws`]; `done` is called after each
    /// throw.
    ///
    /// # Errors
    /// Invalid settings, or a robot that does not get to rest.
    pub fn run_in_a_row(
        &self,
        length: u64,
        done: impl Fn() + Sync,
    ) -> Result<SeriesReport, TrialError> {
        let rows = on_all_cores(0..self.throws.div_ceil(length), |number| {
            let row = self.row(number, length);
            (0..length).for_each(|_| done());
            row
        })?;
        let outcomes = rows.into_iter().flatten().map(|(outcome, _)| outcome);
        Ok(SeriesReport {
            in_a_row: Some(length),
            ..self.report(outcomes.collect())
        })
    }

    /// Simulates row `number`: `length` throws in one world. The robot waits for each in the pose of the last catch,
    /// until its torso is at rest, and its hands are emptied.
    fn row(&self, number: u64, length: u64) -> Result<Vec<RowThrow>, TrialError> {
        let oracle = self.config.oracle();
        let config = ThrowConfig {
            next: NextPose::LastCatch,
            still: TORSO_RESTS,
            ..self.config.clone()
        };
        let seed = world_seed(self.seed, number);
        let mut throw = SimulatedThrow::new(&config, seed, Watching::default())?;
        let first = number * length;
        (first..first + length)
            .map(|number| throw.next_of_row(number, &oracle))
            .collect()
    }

    /// Simulates the first row and returns a file that draws the robot from the side at the end of each flight, and
    /// faintly at the throw, in the pose of the catch before.
    ///
    /// # Errors
    /// Same as [`Series::run_in_a_row`].
    pub fn row_picture(&self, length: u64) -> Result<String, TrialError> {
        let mut svg = String::new();
        for (place, (outcome, trace)) in self.row(0, length)?.iter().enumerate() {
            let caught = outcome.all_caught();
            let plan = trace.plans.last();
            let arm = plan.map_or("no", |plan| ["left", "right"][plan.arm]);
            let [column, row] = [place % COLUMNS, place / COLUMNS].map(|i| i as f64);
            let (x, y) = (column * WIDTH, row * HEIGHT);
            let _ = write!(
                svg,
                "<svg x=\"{x:.0}\" y=\"{y:.0}\" width=\"{WIDTH}\" height=\"{HEIGHT}\">{}<text x=\"12\" y=\"20\">ball {}, {arm} arm, {}</text></svg>",
                content(trace).unwrap_or_default(),
                place + 1,
                if caught { "caught" } else { "missed" }
            );
        }
        let height = (length as usize).div_ceil(COLUMNS) as f64 * HEIGHT;
        let title = "Balls caught one after the other";
        Ok(stand_alone(COLUMNS as f64 * WIDTH, height, title, &svg))
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
        let (no_plans, stops) = (self.stack.no_plans(), self.stack.safety.brakes);
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
            stops: self.stack.safety.brakes - stops,
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
        let series = Series {
            config: ThrowConfig::new(robot.clone(), WorldConfig::default()),
            throws: 3,
            seed: 11,
        };
        let row = series.row(0, 3).unwrap();
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
            assert!(apart(begin, &robot.waiting()) > 0.2);
        }
        assert_eq!(row[2].0.number, 2);
    }
}
