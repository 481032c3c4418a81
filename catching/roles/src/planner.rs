//! Plans of one arm.

use tactnet_catching::plan::{PlanConditions, Planner};
use tactnet_catching_packets::packets::{PlanRequest, PlanResult};
use tactnet_channel::{Bus, Priority, Start, now_ns};

use crate::channels::{PLAN_REQUEST, PLAN_RESULT};
use crate::newest::PATIENCE;
use crate::times::Times;
use crate::translate::{request, result_packet};
use crate::{RoleError, RoleReport, RoleSettings};

/// An answer is to be there so long before its motion begins, ns.
const ON_THE_WAY_NS: u64 = 5_500_000;

/// Returns when a planner gives up a question, ns: it answers then with the best that it has.
pub fn planning_ends_ns(question: &PlanRequest) -> u64 {
    question.start_ns.saturating_sub(ON_THE_WAY_NS)
}

/// Returns the plan for a question, or the nearest miss; `None` for a question with an arm or an objective that there is not.
///
/// - `planner`: of the arm that the question is for
/// - `out_of_time`: ends the search; without an end the same question has the same answer, bit by bit
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
