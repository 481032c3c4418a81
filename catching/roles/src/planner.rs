//! Planner process of one arm.

use tactnet_catching::coordinate::{Answering, answer, request_for};
use tactnet_catching::plan::Planner;
use tactnet_channel::now_ns;

use crate::channels::{PLAN_REQUEST, PLAN_RESULT};
use crate::latest_value::next;
use crate::role::Shell;
use crate::{RoleError, RoleReport};

/// Time from the publication of a plan to that of its path, in ns.
const TO_COORDINATOR_NS: u64 = 1_000_000;

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
        // Then the search ends, and its best result is published.
        let lead_ns = phases.path_lead_ns() + TO_COORDINATOR_NS;
        let deadline = question.start_ns.saturating_sub(lead_ns);
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
