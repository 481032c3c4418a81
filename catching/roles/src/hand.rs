//! Hand process: the relay of commands to the hands on its channels.

use tactnet_catching::hand::{HandInputs, HandRelay};
use tactnet_channel::{Wait, now_ns};

use crate::channels::{HAND_COMMAND, HAND_OPEN, HAND_RELEASE, HAND_TARGET};
use crate::latest_value::{at_most, send};
use crate::role::Shell;
use crate::times::Times;
use crate::{RoleError, RoleReport};

/// Period at which closing times are repeated.
const AGAIN: Wait = at_most(5);

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, stopped) = (shell.bus, shell.stopped);
    let commands = HAND_COMMAND.get(bus)?;
    let mut releases = HAND_RELEASE.new_packets(bus)?;
    let (targets, openings) = (HAND_TARGET.put(bus)?, HAND_OPEN.put(bus)?);
    let mut relay = HandRelay::default();
    let mut times = Times::at(200);
    let mut told = Vec::new();
    (shell.ready)();
    while !stopped() {
        told.clear();
        let mut next = commands.get(AGAIN)?;
        while let Some(packet) = next {
            times.push(now_ns().saturating_sub(packet.header().put_ns));
            told.extend_from_slice(&packet);
            next = commands.try_get()?;
        }
        let inputs = HandInputs {
            commands: &told,
            releases: releases.look()?,
        };
        let outputs = relay.step(now_ns(), &inputs);
        send(&openings, outputs.openings)?;
        send(&targets, outputs.targets)?;
    }
    Ok(times.report(commands.lost() + releases.lost()))
}
