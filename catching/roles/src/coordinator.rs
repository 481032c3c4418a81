//! Coordinator process: the step function of the stack on its channels.

use tactnet_catching::coordinate::{Coordinator, CoordinatorInputs, CoordinatorOutputs};
use tactnet_channel::{Bus, SyncGroup, now_ns};

use crate::channels::{
    CONTROLLER_STATE, COORDINATOR_STEP, HEAD_POSE, JOINT_STATE, PLAN_RESULT, PREDICTION,
};
use crate::latest_value::{at_most, sender};
use crate::role::Shell;
use crate::{RoleError, RoleReport, Times};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let mut coordinator = shell.settings.new_coordinator()?;
    let (mut group, mut step) = coordinator_shell(shell.bus)?;
    let mut lost = 0;
    let times = shell.repeat(25, |times| {
        // The maximum sleep bounds the reaction time to closing times and phase changes.
        group.wait(at_most(2))?;
        lost = step(&mut coordinator, now_ns(), times)?;
        Ok(())
    })?;
    Ok(times.report(lost))
}

/// Takes all waiting packets, performs a step of a coordinator at a time in ns, and sends its packets. Returns the
/// number of packets that were lost so far.
pub type CoordinatorShell =
    Box<dyn FnMut(&mut Coordinator, u64, &mut Times) -> Result<u64, RoleError>>;

/// Opens the channels of a coordinator. Returns those that wake it, and the function that performs a step on them.
///
/// # Errors
/// Missing or broken channels.
pub fn coordinator_shell(bus: &Bus) -> Result<(SyncGroup, CoordinatorShell), RoleError> {
    let (mut joints, mut head) = (JOINT_STATE.latest(bus)?, HEAD_POSE.latest(bus)?);
    let mut controller = CONTROLLER_STATE.latest(bus)?;
    let (mut predictions, mut results) =
        (PREDICTION.new_packets(bus)?, PLAN_RESULT.new_packets(bus)?);
    let steps = COORDINATOR_STEP.put(bus)?;
    let send = sender!(bus, CoordinatorOutputs {
        requests => PLAN_REQUEST, paths => ARM_PATH, body => BODY_PATH, gaze => HEAD_GAZE,
        hands => HAND_COMMAND, order => CONTROLLER_COMMAND, status => CATCH_STATE,
    });
    let group = bus.sync_group(&[&predictions.port, &results.port, &controller.port])?;
    let step: CoordinatorShell = Box::new(move |coordinator, now_ns, times| {
        let inputs = CoordinatorInputs {
            joints: joints.look()?,
            head: head.look()?,
            controller: controller.look()?,
            predictions: predictions.look()?.last(),
            results: results.look()?,
        };
        steps.put_copy(&[inputs.stamps(now_ns)])?;
        send(coordinator.step(now_ns, &inputs))?;
        times.push_since(now_ns, inputs.predictions.is_some());
        Ok(predictions.lost() + results.lost() + controller.port.lost())
    });
    Ok((group, step))
}
