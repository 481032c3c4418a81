//! Planner of one arm as a function from packet to packet.

use std::cell::Cell;

use bytemuck::Zeroable;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{PlanFailure, PlanRequest, PlanResult};

use crate::flight::Flight;
use crate::plan::{
    CatchPlan, CatchPoint, CatchRequest, NoPlan, OtherArm, PlanConditions, Planner, Share,
    Surroundings,
};
use crate::ramp::Ramp;

/// Conditions of an answer that are not in its request.
#[derive(Debug, Clone, Copy)]
pub struct Answering<'a> {
    /// Obstacles, if there is a map.
    pub surroundings: Option<Surroundings<'a>>,
    /// If true, the nearest miss replaces a plan that does not exist.
    pub near_misses: bool,
}

impl Default for Answering<'_> {
    fn default() -> Self {
        Self {
            surroundings: None,
            near_misses: true,
        }
    }
}

/// Returns the plan for a request, or the closest result if none is feasible. Returns `None` if the arm or the
/// objective is unknown.
///
/// - `planner`: planner of the requested arm
/// - `out_of_time`: returns true to end the search; the result of a search that is not cut short is reproducible, bit
///   by bit
pub fn answer(
    planner: &Planner,
    question: &PlanRequest,
    answering: &Answering<'_>,
    out_of_time: impl Fn() -> bool + Copy,
) -> Option<PlanResult> {
    let asked = asked(question)?;
    let cut_short = Cell::new(false);
    let out_of_time = || {
        let ends = out_of_time();
        cut_short.set(cut_short.get() || ends);
        ends
    };
    let conditions = PlanConditions {
        surroundings: answering.surroundings,
        last: (question.has_last == 1).then_some(CatchPoint {
            q: question.last_q,
            t: question.last_t,
        }),
        share: share(question),
        ..PlanConditions::default()
    };
    let plan = planner
        .plan(&asked, &conditions, out_of_time)
        .or_else(|no_plan| {
            if !answering.near_misses {
                return Err(no_plan);
            }
            let miss = planner.plan(&asked, &conditions.nearest_miss(), out_of_time);
            // With a map, the reason of the exact plan is reported.
            miss.map_err(|missed| match answering.surroundings {
                Some(_) => no_plan,
                None => missed,
            })
        });
    Some(PlanResult {
        cut_short: cut_short.get().into(),
        ..result_packet(question, &plan)
    })
}

/// Returns the part of the search that a request asks for.
fn share(question: &PlanRequest) -> Share {
    match question.planners {
        0 | 1 => Share::default(),
        of => Share {
            index: (question.planner % of) as usize,
            of: of as usize,
        },
    }
}

/// Returns the request as planner `planner` of an arm answers it; `None` if it is for another planner.
pub fn request_for(planner: u32, request: &PlanRequest) -> Option<PlanRequest> {
    let asked = match request.planners {
        0 | 1 => planner == request.planner,
        all => planner < all,
    };
    asked.then_some(PlanRequest {
        planner,
        ..*request
    })
}

/// Returns `None` if the arm or the objective of the packet is unknown.
fn asked(packet: &PlanRequest) -> Option<CatchRequest> {
    (packet.arm < ARMS as u64).then_some(())?;
    Some(CatchRequest {
        ball: Flight::of_packet(&packet.flight),
        q0: packet.q0,
        w0: packet.w0,
        earliest: packet.earliest,
        latest: packet.latest,
        objective: packet.objective()?.into(),
        other: (packet.has_other == 1).then(|| OtherArm {
            ramps: packet.other.each_ref().map(Ramp::of),
            since: (packet.start_ns as f64 - packet.other_start_ns as f64) * 1e-9,
        }),
    })
}

fn result_packet(request: &PlanRequest, plan: &Result<CatchPlan, NoPlan>) -> PlanResult {
    let mut packet = PlanResult {
        request: *request,
        ..PlanResult::zeroed()
    };
    match plan {
        Ok(plan) => {
            packet.q = plan.q;
            packet.t = plan.t;
            packet.cost = plan.cost;
            packet.position_error = plan.violation.position;
            packet.angle_error = plan.violation.angle;
            packet.ramps = plan.ramps.each_ref().map(Ramp::packet);
            packet.starts = plan.effort.starts as u32;
            packet.iterations = plan.effort.iterations as u32;
        }
        Err(no_plan) => packet.failure = failure(no_plan) as u64,
    }
    packet
}

fn failure(no_plan: &NoPlan) -> PlanFailure {
    match no_plan {
        NoPlan::Request(_) => PlanFailure::Request,
        NoPlan::OutOfReach => PlanFailure::OutOfReach,
        NoPlan::NoCatch => PlanFailure::NoCatch,
        NoPlan::OutOfTime => PlanFailure::OutOfTime,
        NoPlan::Obstructed => PlanFailure::Obstructed,
    }
}

#[cfg(test)]
mod tests {
    use tactnet_catching_packets::packets::PlanObjective;

    use super::*;
    use crate::plan::{Effort, Objective, PlanConfig, Violation};

    #[test]
    fn a_request_asks_with_all_its_numbers_and_only_for_known_arms_and_objectives() {
        let flight = Flight {
            p: [1.0, 2.0, 3.0].into(),
            v: [-5.0, 0.1, 1.0].into(),
            k: 0.03,
            lift: [0.0, 0.01, 0.0].into(),
        };
        let other = Ramp::braking(0.1, -0.4, 8.0);
        let packet = PlanRequest {
            arm: 1,
            start_ns: 1_000_000_000,
            flight: flight.packet(1_000_000_000),
            q0: [0.2; 7],
            w0: [0.3; 7],
            earliest: 0.05,
            latest: 1.8,
            objective: PlanObjective::Cool as u64,
            has_other: 1,
            other_start_ns: 750_000_000,
            other: [other.packet(); 7],
            ..PlanRequest::zeroed()
        };
        let expected = CatchRequest {
            ball: flight,
            q0: [0.2; 7],
            w0: [0.3; 7],
            earliest: 0.05,
            latest: 1.8,
            objective: Objective::Cool,
            other: Some(OtherArm {
                ramps: [other; 7],
                since: 0.25,
            }),
        };
        assert_eq!(asked(&packet), Some(expected));
        assert_eq!(asked(&PlanRequest { arm: 2, ..packet }), None);
        let unknown = PlanRequest {
            objective: 9,
            ..packet
        };
        assert_eq!(asked(&unknown), None);
    }

    #[test]
    fn a_search_that_the_time_limit_ends_is_reported_as_cut_short() {
        let robot = crate::robot::Robot::nominal();
        let planner = Planner::new(&robot, 0, PlanConfig::default());
        let target = [0.7, 0.4, 0.2].into();
        let flight = Flight::without_spin(target, [-5.5, 0.0, -2.0].into(), 0.03).after(-0.7);
        let question = PlanRequest {
            flight: flight.packet(0),
            earliest: 0.0,
            latest: 1.8,
            objective: PlanObjective::Soft as u64,
            ..PlanRequest::zeroed()
        };
        // The result may depend on the limit as soon as it expires during the search, at whichever of its looks.
        let looks = Cell::new(0);
        let cut_short_at = |look: u32| {
            looks.set(0);
            let ends = || looks.replace(looks.get() + 1) == look;
            answer(&planner, &question, &Answering::default(), ends)
                .unwrap()
                .cut_short
        };
        assert_eq!(cut_short_at(u32::MAX), 0);
        let all = looks.get();
        assert!(all > 10, "{all}");
        for look in [0, all / 2, all - 1] {
            assert_eq!(cut_short_at(look), 1, "look {look} of {all}");
        }
    }

    #[test]
    fn a_result_holds_the_plan_or_the_reason_of_its_absence() {
        let packet = PlanRequest::zeroed();
        let plan = CatchPlan {
            q: [0.5; 7],
            t: 0.6,
            ramps: [Ramp::braking(0.2, 0.3, 9.0); 7],
            cost: 1.5,
            violation: Violation::default(),
            effort: Effort::default(),
        };
        let result = result_packet(&packet, &Ok(plan));
        assert_eq!(result.failure(), Some(PlanFailure::NotFailed));
        assert_eq!((result.q, result.t, result.cost), (plan.q, 0.6, 1.5));
        assert_eq!(result.ramps.each_ref().map(Ramp::of), plan.ramps);
        assert_eq!(result.cut_short, 0);
        let missing = result_packet(&packet, &Err(NoPlan::Obstructed));
        assert_eq!(missing.failure(), Some(PlanFailure::Obstructed));
    }
}
