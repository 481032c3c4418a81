//! Thrower process: throwing back on its channels.

use tactnet_catching::throw_back::{ThrowInputs, ThrowOutputs, ThrowTask};
use tactnet_channel::{Wait, now_ns};

use crate::channels::{
    ARM_PATH, CATCH_FELT, CATCH_STATE, CONTROLLER_STATE, HAND_STATE, PREDICTION,
};
use crate::latest_value::{at_most, sender};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

/// Maximum sleep, which is also the period of repeated commands to the hand.
const BEAT: Wait = at_most(4);

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let corrections = settings.corrections()?;
    let existence = settings.coordinator.existence;
    let mut task = ThrowTask::new(corrections.robot(), settings.throw, existence);
    let (mut hand, mut status) = (HAND_STATE.latest(bus)?, CATCH_STATE.latest(bus)?);
    let (mut controller, mut felt) = (CONTROLLER_STATE.latest(bus)?, CATCH_FELT.latest_ever(bus)?);
    let (mut predictions, mut paths) = (PREDICTION.new_packets(bus)?, ARM_PATH.new_packets(bus)?);
    let send = sender!(bus, ThrowOutputs {
        path => THROW_PATH, release => HAND_RELEASE, status => THROW_STATE,
    });
    let times = shell.repeat(1, |times| {
        let controller = controller.wait(BEAT)?;
        let felt = felt.look()?.map_or(0, |felt| felt.grip);
        let now = now_ns();
        let inputs = ThrowInputs {
            hand: hand.look()?,
            status: status.look()?,
            controller,
            felt: settings.throw.after_feeling.then_some(felt),
            predictions: predictions.look()?,
            paths: paths.look()?,
        };
        let outputs = task.step(now, &inputs);
        times.push_since(now, outputs.path.is_some());
        send(outputs)
    })?;
    Ok(times.report(predictions.lost() + paths.lost()))
}
