//! Safety process: the monitor of self-collisions on its channels.

use tactnet_catching::safety::SafetyWatch;
use tactnet_channel::now_ns;

use crate::channels::{JOINT_COMMAND, SAFETY_STATE};
use crate::latest_value::next;
use crate::role::Shell;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let mut watch = SafetyWatch::new(settings.corrections()?);
    let (commands, states) = (JOINT_COMMAND.get(bus)?, SAFETY_STATE.put(bus)?);
    let times = shell.repeat(1000, |times| {
        let Some(command) = next(&commands)? else {
            return Ok(());
        };
        let begun = now_ns();
        let mut verdict = watch.step(&command);
        verdict.computing_ns = now_ns() - begun;
        states.put_copy(&[verdict])?;
        times.push(verdict.computing_ns);
        watch.count(&command, &verdict);
        Ok(())
    })?;
    Ok(RoleReport {
        brakes: watch.brakes,
        brakes_in_vain: watch.brakes_in_vain,
        ..times.report(commands.lost())
    })
}
