//! Plan requests and their results.

use tactnet_catching::coordinate::{CatchState, PlanRequest, Planned};
use tactnet_catching::ramp::Ramp;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{ArmPath, BallPredictions, PlanResult};

use super::{CoordinatorTask, MeasuredPose};
use crate::RoleError;
use crate::translate::{Origin, body_packet, planned, request_packet};

/// Time before its start at which a path is sent, in ns. It exceeds the delay of the drives.
const ON_THE_WAY_NS: u64 = 4_500_000;
/// Maximum delay after that moment at which a path is still sent, in ns.
const LATE_NS: u64 = 500_000;
/// Window before the latest possible moment in which the last correction is requested, in ns: two cycles.
const LAST_CHANCE_NS: u64 = 4_000_000;

/// Plan requests that wait for their results.
pub(super) struct PendingPlans {
    origin: Origin,
    start_ns: u64,
    count: usize,
    answers: Vec<Planned>,
}

impl CoordinatorTask {
    /// Requests plans for predictions.
    ///
    /// - `arms`: arms to plan for
    pub(super) fn request_plans(
        &mut self,
        arms: [bool; ARMS],
        now_ns: u64,
        predictions: &BallPredictions,
        pose: MeasuredPose,
    ) -> Result<(), RoleError> {
        let known = pose.is_fresh(now_ns);
        let Some(coordinator) = self.coordinator.as_mut().filter(|_| known) else {
            return Ok(());
        };
        self.predictions = Some(*predictions);
        let chest = pose.chest(&self.corrections);
        let before = coordinator.state();
        let requests = coordinator.predictions_for(arms, now_ns, predictions, &chest);
        if coordinator.state() == CatchState::Armed {
            return Ok(());
        }
        let valid = predictions
            .valid()
            .iter()
            .any(|ball| ball.existence >= self.settings.coordinator.existence);
        if valid {
            self.seen_ns = now_ns;
        }
        let body = coordinator.body();
        if body.start_ns != self.body_ns && before == CatchState::Armed {
            self.body_ns = body.start_ns;
            self.puts.body.put_copy(&[body_packet(body)])?;
        }
        self.look_at_balls(now_ns)?;
        let origin = Origin {
            call: self.calls + 1,
            exposure_ns: predictions.exposure_ns,
            head_ns: pose.head.t_ns,
        };
        self.send_requests(origin, requests.iter().flatten())?;
        self.tell_hands()
    }

    fn send_requests<'a>(
        &mut self,
        origin: Origin,
        requests: impl Iterator<Item = &'a PlanRequest>,
    ) -> Result<(), RoleError> {
        let (mut start_ns, mut count) = (0, 0);
        for request in requests {
            (start_ns, count) = (request.start_ns, count + 1);
            let packet = request_packet(request, origin);
            self.puts.requests.put_copy(&[packet])?;
        }
        if count > 0 {
            self.calls = origin.call;
            self.pending = Some(PendingPlans {
                origin,
                start_ns,
                count,
                answers: Vec::with_capacity(count),
            });
        }
        Ok(())
    }

    /// Requests one last correction from the latest head pose, just before a path becomes final. Pictures arrive
    /// every 40 ms, poses of the inertial unit much more often.
    pub(super) fn correct_last(
        &mut self,
        now_ns: u64,
        pose: MeasuredPose,
    ) -> Result<(), RoleError> {
        let config = &self.settings.coordinator;
        let nanoseconds = |seconds: f64| (seconds * 1e9) as u64;
        let ahead = nanoseconds(config.plan_delay + config.last_correction);
        let Some(predictions) = self.predictions.filter(|_| self.pending.is_none()) else {
            return Ok(());
        };
        let Some(coordinator) = self
            .coordinator
            .as_ref()
            .filter(|coordinator| coordinator.state() == CatchState::Reaching)
        else {
            return Ok(());
        };
        let due = std::array::from_fn(|arm| {
            coordinator.target(arm).is_some_and(|(_, catch_ns)| {
                let last = catch_ns.saturating_sub(ahead);
                (last.saturating_sub(LAST_CHANCE_NS)..last).contains(&now_ns)
            })
        });
        if due != [false; ARMS] {
            self.request_plans(due, now_ns, &predictions, pose)?;
        }
        Ok(())
    }

    /// Stores a result of the pending requests.
    pub(super) fn take(&mut self, result: &PlanResult) {
        let Some(pending) = self
            .pending
            .as_mut()
            .filter(|pending| pending.origin.call == result.request.call)
        else {
            return;
        };
        pending.answers.extend(planned(result));
    }

    /// Decides once all plans have arrived or the time is over.
    pub(super) fn answer(&mut self, now_ns: u64) -> Result<(), RoleError> {
        let latest = |pending: &PendingPlans| pending.start_ns.saturating_sub(ON_THE_WAY_NS);
        let Some(pending) = self
            .pending
            .take_if(|pending| pending.answers.len() >= pending.count || now_ns >= latest(pending))
        else {
            return Ok(());
        };
        let Some(coordinator) = &mut self.coordinator else {
            return Ok(());
        };
        // Late paths are discarded.
        let answers = if now_ns <= latest(&pending) + LATE_NS {
            &pending.answers[..]
        } else {
            &[]
        };
        coordinator.planned(answers);
        for arm in 0..ARMS {
            let (start_ns, ramps) = coordinator.arm(arm);
            let target = coordinator.target(arm);
            let Some((ball, _)) = target.filter(|_| start_ns != self.sent[arm]) else {
                continue;
            };
            self.sent[arm] = start_ns;
            self.sent_ns = now_ns;
            self.puts.arms.put_copy(&[ArmPath {
                arm: arm as u64,
                ball,
                exposure_ns: pending.origin.exposure_ns,
                head_ns: pending.origin.head_ns,
                start_ns,
                ramps: ramps.each_ref().map(Ramp::packet),
            }])?;
        }
        self.tell_hands()
    }

    fn tell_hands(&mut self) -> Result<(), RoleError> {
        let Some(coordinator) = &self.coordinator else {
            return Ok(());
        };
        let wanted = *coordinator.hands();
        for (told, hand) in self.hands.iter_mut().zip(wanted) {
            if let Some(command) = hand.filter(|_| *told != hand) {
                self.puts.hands.put_copy(&[command])?;
            }
            *told = hand;
        }
        Ok(())
    }
}
