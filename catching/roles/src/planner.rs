//! Planner process of one arm.

use tactnet_catching::plan::{PlanConditions, Planner};
use tactnet_catching_packets::packets::{PlanRequest, PlanResult};
use tactnet_channel::{Bus, Priority, Start, now_ns};

use crate::channels::{PLAN_REQUEST, PLAN_RESULT};
use crate::latest_value::PATIENCE;
use crate::times::Times;
use crate::translate::{request, result_packet};
use crate::{RoleError, RoleReport, RoleSettings};

/// Time before the start of a motion at which its plan must be published, in ns.
const ON_THE_WAY_NS: u64 = 5_500_000;

/// Returns the time at which a planner stops its search and publishes its best result, in ns.
pub fn planning_ends_ns(question: &PlanRequest) -> u64 {
    question.start_ns.saturating_sub(ON_THE_WAY_NS)
}

/// Returns the plan for a request, or the closest result if none is feasible. Returns `None` if the arm or the
/// objective is unknown.
///
/// - `planner`: planner of the requested arm
/// - `out_of_time`: returns true to end the search; a search that is never ended has a reproducible result, bit by
///   bit
pub fn answer(
    planner: &Planner,
    question: &PlanRequest,
    out_of_time: impl Fn() -> bool + Copy,
) -> Option<PlanResult> {
    let asked = request(question)?;
    let conditions = PlanConditions {
        last: asked.last,
        ..PlanConditions::default()
    };
    let plan = planner
        .plan(&asked.catch, &conditions, out_of_time)
        .or_else(|_| planner.plan(&asked.catch, &conditions.nearest_miss(), out_of_time));
    Some(result_packet(question, &plan))
}

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    arm: usize,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let corrections = settings.corrections()?;
    let requests = bus.get_port::<PlanRequest>(PLAN_REQUEST, Start::Now)?;
    let results = bus.put_port::<PlanResult>(PLAN_RESULT, Priority::High)?;
    let mut times = Times::at(100);
    let planner = Planner::new(corrections.robot(), arm, settings.planner);
    ready();
    while !stopped() {
        let Some(packet) = requests.get(PATIENCE)? else {
            continue;
        };
        let Some(question) = packet.first().filter(|question| question.arm == arm as u64) else {
            continue;
        };
        let begun = now_ns();
        let deadline = planning_ends_ns(question);
        let out_of_time = || now_ns() >= deadline;
        let Some(mut answer) = answer(&planner, question, out_of_time) else {
            continue;
        };
        answer.computing_ns = now_ns() - begun;
        results.put_copy(&[answer])?;
        times.push(answer.computing_ns);
    }
    Ok(RoleReport {
        lost: requests.lost(),
        ..times.report()
    })
}
