//! Coordinator process: the step function of the stack on its channels.

use tactnet_catching::coordinate::{Coordinator, CoordinatorInputs};
use tactnet_channel::{Bus, SyncGroup, Wait, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CATCH_STATE, CONTROLLER_COMMAND, CONTROLLER_STATE, COORDINATOR_STEP,
    HAND_COMMAND, HEAD_GAZE, HEAD_POSE, JOINT_STATE, PLAN_REQUEST, PLAN_RESULT, PREDICTION,
};
use crate::latest_value::{at_most, send};
use crate::role::Shell;
use crate::times::Times;
use crate::{RoleError, RoleReport};

/// Maximum sleep, which bounds the reaction time to closing times and phase changes.
const BEAT: Wait = at_most(2);

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings, stopped) = (shell.bus, &shell.settings, shell.stopped);
    let mut coordinator = settings.new_coordinator()?;
    let (mut group, mut step) = coordinator_shell(bus)?;
    let mut times = Times::at(25);
    let mut lost = 0;
    (shell.ready)();
    while !stopped() {
        group.wait(BEAT)?;
        let begun = now_ns();
        let taken = step(&mut coordinator, begun)?;
        if taken.predictions {
            times.push(now_ns() - begun);
        }
        lost = taken.lost;
    }
    Ok(times.report(lost))
}

/// Packets that a step of the coordinator took from its channels.
#[derive(Debug, Clone, Copy)]
pub struct StepTaken {
    /// True if there were predictions.
    pub predictions: bool,
    /// Number of packets that were lost so far.
    pub lost: u64,
}

/// Takes all waiting packets, performs a step of a coordinator at a time in ns, and sends its packets.
pub type CoordinatorShell = Box<dyn FnMut(&mut Coordinator, u64) -> Result<StepTaken, RoleError>>;

/// Opens the channels of a coordinator. Returns those that wake it, and the function that performs a step on them.
///
/// # Errors
/// Missing or broken channels.
pub fn coordinator_shell(bus: &Bus) -> Result<(SyncGroup, CoordinatorShell), RoleError> {
    let (mut joints, mut head) = (JOINT_STATE.latest(bus)?, HEAD_POSE.latest(bus)?);
    let (mut controller, mut results) =
        (CONTROLLER_STATE.latest(bus)?, PLAN_RESULT.new_packets(bus)?);
    let mut predictions = PREDICTION.new_packets(bus)?;
    let (steps, requests) = (COORDINATOR_STEP.put(bus)?, PLAN_REQUEST.put(bus)?);
    let (paths, bodies) = (ARM_PATH.put(bus)?, BODY_PATH.put(bus)?);
    let (gazes, hands) = (HEAD_GAZE.put(bus)?, HAND_COMMAND.put(bus)?);
    let (orders, states) = (CONTROLLER_COMMAND.put(bus)?, CATCH_STATE.put(bus)?);
    let group = bus.sync_group(&[&predictions.port, &results.port, &controller.port])?;
    let step = move |coordinator: &mut Coordinator, now_ns: u64| -> Result<StepTaken, RoleError> {
        let inputs = CoordinatorInputs {
            joints: joints.look()?,
            head: head.look()?,
            controller: controller.look()?,
            predictions: predictions.look()?.last(),
            results: results.look()?,
        };
        steps.put_copy(&[inputs.stamps(now_ns)])?;
        let outputs = coordinator.step(now_ns, &inputs);
        let taken = inputs.predictions.is_some();
        send(&requests, outputs.requests)?;
        send(&paths, outputs.paths)?;
        send(&bodies, [outputs.body])?;
        send(&gazes, [outputs.gaze])?;
        send(&hands, outputs.hands)?;
        send(&orders, [outputs.order])?;
        send(&states, [outputs.status])?;
        Ok(StepTaken {
            predictions: taken,
            lost: predictions.lost() + results.lost() + controller.port.lost(),
        })
    };
    Ok((group, Box::new(step)))
}
