//! Planner process of one arm.

use tactnet_catching::coordinate::{Answering, PhaseConfig, answer, request_for};
use tactnet_catching::plan::Planner;
use tactnet_catching_packets::packets::PlanRequest;
use tactnet_channel::now_ns;

use crate::channels::{PLAN_REQUEST, PLAN_RESULT};
use crate::latest_value::next;
use crate::role::Shell;
use crate::{RoleError, RoleReport};

/// Time from the publication of a plan to that of its path, in ns.
const TO_COORDINATOR_NS: u64 = 1_000_000;

/// Returns the time at which a planner stops its search and publishes its best result, in ns.
///
/// - `phases`: settings of the coordinator that asks
fn planning_ends_ns(question: &PlanRequest, phases: &PhaseConfig) -> u64 {
    question
        .start_ns
        .saturating_sub(phases.path_lead_ns() + TO_COORDINATOR_NS)
}

/// - `number`: number among the planners of the arm, from 0
pub(crate) fn run(shell: &Shell<'_>, arm: usize, number: u32) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let corrections = settings.corrections()?;
    let (requests, results) = (PLAN_REQUEST.get(bus)?, PLAN_RESULT.put(bus)?);
    let planner = Planner::new(corrections.robot(), arm, settings.planner);
    let phases = settings.phases();
    let times = shell.repeat(100, |times| {
        let request = next(&requests)?.filter(|request| request.arm == arm as u64);
        let Some(question) = request.and_then(|request| request_for(number, &request)) else {
            return Ok(());
        };
        let begun = now_ns();
        let deadline = planning_ends_ns(&question, &phases);
        let out_of_time = || now_ns() >= deadline;
        let plan = answer(&planner, &question, &Answering::default(), out_of_time);
        if let Some(mut plan) = plan {
            plan.computing_ns = now_ns() - begun;
            results.put_copy(&[plan])?;
            times.push(plan.computing_ns);
        }
        Ok(())
    })?;
    Ok(times.report(requests.lost()))
}
