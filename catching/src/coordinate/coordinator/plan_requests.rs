//! Plan requests and their results.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{
    ArmPath, BallPredictions, PlanFailure, PlanRequest, PlanResult,
};

use super::{Armed, Coordinator, CoordinatorOutputs, MeasuredPose, SILENT_NS, Step};
use crate::coordinate::attempt::CatchState;
use crate::plan::Violation;
use crate::ramp::Ramp;

/// Maximum delay after the latest moment at which a path is still sent, in ns.
const LATE_NS: u64 = 500_000;
/// Window before the latest possible moment in which the last correction is requested, in ns: two cycles.
const LAST_CHANCE_NS: u64 = 4_000_000;

/// Plan requests that wait for their results.
#[derive(Debug, Clone, Copy)]
pub(super) struct PendingPlans {
    first: PlanRequest,
    /// Number of results that are missing.
    missing: u32,
}

impl Coordinator {
    /// Requests plans for predictions.
    ///
    /// - `arms`: arms to plan for
    pub(super) fn request_plans(
        &mut self,
        arms: [bool; ARMS],
        predictions: &BallPredictions,
        pose: MeasuredPose<'_>,
        step: &mut Step,
    ) {
        let (now_ns, outputs) = (step.now_ns, &mut step.outputs);
        let chest = pose.chest(&self.corrections);
        let oldest_ns = pose.head.t_ns.min(pose.joints.sensor_ns);
        let fresh = now_ns.saturating_sub(oldest_ns) < SILENT_NS;
        let Some(armed) = self.armed.as_mut().filter(|_| fresh) else {
            return;
        };
        armed.predictions = Some(*predictions);
        let before = armed.attempt.state;
        let requests = armed.attempt.predictions(arms, now_ns, predictions, &chest);
        if armed.attempt.state == CatchState::Armed {
            return;
        }
        let valid = |ball: f32| ball >= self.config.existence;
        if predictions.valid().iter().any(|ball| valid(ball.existence)) {
            armed.seen_ns = now_ns;
        }
        let body = armed.attempt.body;
        if before == CatchState::Armed {
            outputs.body = (body.start_ns > 0).then(|| body.packet());
            let [first, _] = armed.attempt.looked_at;
            armed.came_from = first.map(|(_, flight)| flight.p);
        }
        let (call, planners) = (self.calls + 1, self.config.planners());
        let requests = requests.map(|request| {
            request.map(|request| PlanRequest {
                call,
                exposure_ns: predictions.exposure_ns,
                head_ns: pose.head.t_ns,
                // A first plan is for all planners, its corrections for one after the other.
                planner: (call % u64::from(planners)) as u32,
                planners: if request.has_last == 1 { 1 } else { planners },
                ..request
            })
        });
        if let Some(first) = requests[0] {
            self.calls = call;
            armed.answers.clear();
            let asked = requests.iter().flatten();
            let missing = asked.map(|request| request.planners).sum();
            armed.pending = Some(PendingPlans { first, missing });
            outputs.requests = requests;
        }
        armed.tell_hands(outputs);
        self.look_at_balls(step);
    }

    /// Requests one last correction from the latest head pose, just before a path becomes final. Pictures arrive
    /// every 40 ms, poses of the inertial unit much more often.
    pub(super) fn correct_last(&mut self, pose: MeasuredPose<'_>, step: &mut Step) {
        let ahead = self.config.plan_delay + self.config.last_correction;
        let ahead_ns = (ahead * 1e9) as u64;
        let Some(armed) = self.armed.as_ref().filter(|armed| armed.pending.is_none()) else {
            return;
        };
        let reaching = armed.attempt.state == CatchState::Reaching;
        let Some(predictions) = armed.predictions.filter(|_| reaching) else {
            return;
        };
        let due = std::array::from_fn(|arm| {
            armed.attempt.target(arm).is_some_and(|(_, catch_ns)| {
                let last = catch_ns.saturating_sub(ahead_ns);
                (last.saturating_sub(LAST_CHANCE_NS)..last).contains(&step.now_ns)
            })
        });
        if due != [false; ARMS] {
            self.request_plans(due, &predictions, pose, step);
        }
    }

    /// Stores a result of the pending requests: of planners that share a search the best one.
    pub(super) fn take(&mut self, result: &PlanResult) {
        let Some(armed) = &mut self.armed else {
            return;
        };
        let is_of = |pending: &&mut PendingPlans| {
            pending.first.call == result.request.call && pending.missing > 0
        };
        let pending = armed.pending.as_mut().filter(is_of);
        let Some(pending) = pending.filter(|_| is_usable(result)) else {
            return;
        };
        pending.missing -= 1;
        let asked = |of: &PlanResult| (of.request.arm, of.request.ball);
        let mut answers = armed.answers.iter_mut();
        match answers.find(|other| asked(other) == asked(result)) {
            Some(other) if is_better(result, other) => *other = *result,
            Some(_) => {}
            None => armed.answers.push(*result),
        }
    }

    /// Decides once all plans have arrived or the time is over.
    pub(super) fn answer(&mut self, step: &mut Step) {
        let (now_ns, outputs) = (step.now_ns, &mut step.outputs);
        let lead_ns = self.phases.path_lead_ns();
        let latest = |pending: &PendingPlans| pending.first.start_ns.saturating_sub(lead_ns);
        let Some(armed) = &mut self.armed else {
            return;
        };
        let Some(pending) = armed
            .pending
            .take_if(|pending| pending.missing == 0 || now_ns >= latest(pending))
        else {
            return;
        };
        if now_ns > latest(&pending) + LATE_NS {
            // Late paths are discarded.
            armed.answers.clear();
        }
        armed.attempt.planned(&armed.answers);
        for arm in 0..ARMS {
            let (start_ns, ramps) = armed.attempt.arm(arm);
            let target = armed.attempt.target(arm);
            let Some((ball, _)) = target.filter(|_| start_ns != armed.sent[arm]) else {
                continue;
            };
            armed.sent[arm] = start_ns;
            self.sent_ns = now_ns;
            outputs.paths[arm] = Some(ArmPath {
                arm: arm as u64,
                ball,
                exposure_ns: pending.first.exposure_ns,
                head_ns: pending.first.head_ns,
                start_ns,
                ramps: ramps.each_ref().map(Ramp::packet),
            });
        }
        armed.tell_hands(outputs);
    }
}

impl Armed {
    /// Sends closing times that have changed.
    fn tell_hands(&mut self, outputs: &mut CoordinatorOutputs) {
        let wanted = self.attempt.hands;
        for arm in 0..ARMS {
            if wanted[arm].is_some() && wanted[arm] != self.hands[arm] {
                outputs.hands[arm] = wanted[arm];
            }
        }
        self.hands = wanted;
    }
}

/// Returns true if a result replaces another one of the same request: exact catches come before near misses, and
/// these before no plan. Of equally good results the planner with the lower number counts, in any order of arrival.
fn is_better(result: &PlanResult, other: &PlanResult) -> bool {
    let rank = |of: &PlanResult| {
        let violation = Violation {
            position: of.position_error,
            angle: of.angle_error,
            ..Violation::default()
        };
        match of.failure() {
            Some(PlanFailure::NotFailed) if violation.is_feasible() => (0, of.cost),
            Some(PlanFailure::NotFailed) => (1, of.position_error),
            _ => (2, 0.0),
        }
    };
    let ((kind, cost), (other_kind, other_cost)) = (rank(result), rank(other));
    let costs = cost.total_cmp(&other_cost);
    let numbers = result.request.planner.cmp(&other.request.planner);
    kind.cmp(&other_kind).then(costs).then(numbers).is_lt()
}

/// Returns true for a plan with finite numbers, and for a valid request without a plan.
fn is_usable(result: &PlanResult) -> bool {
    let mut ramps = result.ramps.iter().map(Ramp::of);
    let mut numbers = result.q.iter().chain([&result.t, &result.cost]);
    let finite = numbers.all(|x| x.is_finite()) && ramps.all(|ramp| ramp.is_finite());
    match result.failure() {
        _ if result.request.arm >= ARMS as u64 => false,
        Some(PlanFailure::NotFailed) => finite && (0.0..10.0).contains(&result.t),
        Some(PlanFailure::Request) | None => false,
        Some(_) => true,
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;

    #[test]
    fn results_with_numbers_that_are_not_finite_are_not_used() {
        let plan = PlanResult::zeroed();
        assert!(is_usable(&plan));
        let of = |failure: PlanFailure| {
            let mut without = PlanResult::zeroed();
            (without.failure, without.t) = (failure as u64, f64::NAN);
            without
        };
        assert!(is_usable(&of(PlanFailure::NoCatch)));
        assert!(!is_usable(&of(PlanFailure::Request)));
        assert!(!is_usable(&of(PlanFailure::NotFailed)));
        let mut spoilt = plan;
        spoilt.ramps[6].a = f64::NAN;
        assert!(!is_usable(&spoilt));
        let mut nobody = plan;
        nobody.request.arm = 2;
        assert!(!is_usable(&nobody));
    }
}
