//! Catching of the other robot's throws, with the same parts as in series of throws.

use std::collections::VecDeque;

use nalgebra::Vector2;
use tactnet_catching::coordinate::{CatchState, Coordinator, Planned};
use tactnet_catching::throw::Landing;
use tactnet_catching_packets::ARMS;
use tactnet_catching_world::{Released, TICK_NS, Verdict};

use super::player::Player;
use crate::ablation::Ablation;
use crate::error::TrialError;
use crate::look_ahead::{TimedPrediction, as_flight};
use crate::perception::Perception;
use crate::series::cause;
use crate::stepped_time::{nanoseconds, ticks};
use crate::throw::{Answers, answer};
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
        let ready = self.config.ready();
        let robot = self.config.robot.clone();
        let mut perception = Perception::new(&self.config, 0)?;
        let mut coordinator = Coordinator::new(robot, self.config.coordination(), ready);
        let mut answers: VecDeque<Answers> = VecDeque::new();
        let mut said: Vec<TimedPrediction> = Vec::new();
        let near = !self.config.is_without(Ablation::NearMiss);
        let ahead_ns = nanoseconds(self.config.timing.drives);
        let before = self.world.verdicts().len();
        let mut left = ticks(LONGEST);
        let mut tick = 0;
        while left > 0 {
            left -= 1;
            let now_ns = self.world.time_ns();
            if tick == ticks(REST) {
                // The ticks of both worlds may have an offset.
                let ago = (TICK_NS - released.at_ns % TICK_NS) as f64 * 1e-9;
                self.world.launch(released, ago);
            } else if tick < ticks(REST) {
                left = ticks(LONGEST);
            }
            while let Some(due) = answers.pop_front_if(|answer| answer.due_ns <= now_ns) {
                coordinator.planned(&due.answers);
            }
            while let Some(seen) = perception.predictions(now_ns)? {
                said.extend(seen.said());
                let requests = coordinator.predictions(now_ns, &seen.predictions, &seen.chest);
                let asked: Vec<Planned> = requests
                    .iter()
                    .flatten()
                    .map(|request| answer(&self.planners, request, None, near))
                    .collect();
                if !asked.is_empty() {
                    answers.push_back(Answers {
                        due_ns: now_ns + nanoseconds(self.config.timing.to_path()),
                        answers: asked,
                    });
                }
            }
            let command = coordinator.tick(now_ns + ahead_ns);
            let sensed = self.step(command, coordinator.hands());
            perception.sense(
                &sensed,
                &self.world.truth(),
                coordinator.state() == CatchState::Armed,
            )?;
            if self.world.verdicts().len() > before {
                left = left.min(ticks(STANDS));
            }
            tick += 1;
        }
        // The last commands continue until the joints stand still.
        let verdict = self.world.verdicts().get(before).copied();
        Ok(self.judge(verdict, &coordinator, &said, released, target, oracle))
    }

    fn judge(
        &self,
        verdict: Option<Verdict>,
        coordinator: &Coordinator,
        said: &[TimedPrediction],
        released: &Released,
        target: &[f64; 3],
        oracle: &CatchSpace,
    ) -> Catch {
        let flight = self.world.flight_of(released);
        let cameras = &self.config.robot.description().cameras;
        let reaction = self.config.timing.reaction(cameras.rate);
        let planned = (0..ARMS).any(|arm| coordinator.target(arm).is_some());
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
