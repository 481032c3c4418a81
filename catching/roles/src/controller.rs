//! Controller process: the control loop of the stack on its channels, at 1 kHz.

use tactnet_catching::control::{ControlInputs, ControlLoop};
use tactnet_channel::{Ticker, now_ns};

use crate::channels::{
    ARM_PATH, BODY_PATH, CONTROLLER_COMMAND, CONTROLLER_STATE, HEAD_GAZE, JOINT_COMMAND,
    JOINT_STATE, SAFETY_STATE, THROW_PATH,
};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let mut control = ControlLoop::new(settings.corrections()?, settings.control());
    let mut joints = JOINT_STATE.latest(bus)?;
    let mut verdict = SAFETY_STATE.latest(bus)?;
    let mut orders = CONTROLLER_COMMAND.new_packets(bus)?;
    let mut paths = ARM_PATH.new_packets(bus)?;
    let mut throws = THROW_PATH.new_packets(bus)?;
    let mut bodies = BODY_PATH.new_packets(bus)?;
    let mut gazes = HEAD_GAZE.new_packets(bus)?;
    let (commands, states) = (JOINT_COMMAND.put(bus)?, CONTROLLER_STATE.put(bus)?);
    let mut ticker = Ticker::aligned(1000.0, 0);
    let mut slowest_ns = 0;
    let times = shell.repeat(1000, |times| {
        let beat_ns = ticker.next_ns();
        ticker.wait();
        let inputs = ControlInputs {
            joints: joints.look()?,
            verdict: verdict.look()?,
            orders: orders.look()?,
            paths: paths.look()?,
            throws: throws.look()?,
            bodies: bodies.look()?,
            gazes: gazes.look()?,
        };
        let Some(outputs) = control.step(beat_ns, &inputs) else {
            return Ok(());
        };
        commands.put_copy(&[outputs.command])?;
        let taken = now_ns().saturating_sub(beat_ns);
        times.push(taken);
        slowest_ns = slowest_ns.max(taken);
        if let Some(mut state) = outputs.state {
            state.loop_ns = std::mem::take(&mut slowest_ns);
            states.put_copy(&[state])?;
        }
        Ok(())
    })?;
    Ok(times.report(paths.lost() + throws.lost() + orders.lost()))
}
