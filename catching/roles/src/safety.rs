//! Safety process: the monitor of self-collisions on its channels.

use tactnet_catching::safety::SafetyWatch;
use tactnet_channel::now_ns;

use crate::channels::{JOINT_COMMAND, SAFETY_STATE};
use crate::latest_value::PATIENCE;
use crate::role::Shell;
use crate::times::Times;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings, stopped) = (shell.bus, &shell.settings, shell.stopped);
    let mut watch = SafetyWatch::new(settings.corrections()?);
    let (commands, states) = (JOINT_COMMAND.get(bus)?, SAFETY_STATE.put(bus)?);
    let mut times = Times::at(1000);
    (shell.ready)();
    while !stopped() {
        let Some(packet) = commands.get(PATIENCE)? else {
            continue;
        };
        let Some(command) = packet.first() else {
            continue;
        };
        let begun = now_ns();
        let mut verdict = watch.step(command);
        verdict.computing_ns = now_ns() - begun;
        states.put_copy(&[verdict])?;
        times.push(verdict.computing_ns);
        watch.count(command, &verdict);
    }
    Ok(RoleReport {
        brakes: watch.brakes(),
        brakes_in_vain: watch.brakes_in_vain(),
        ..times.report(commands.lost())
    })
}
