//! Hand process: the relay of commands to the hands on its channels.

use tactnet_catching::hand::{HandInputs, HandOutputs, HandRelay};
use tactnet_channel::{Wait, now_ns};

use crate::channels::{HAND_COMMAND, HAND_RELEASE};
use crate::latest_value::{at_most, sender};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

/// Period at which closing times are repeated.
const AGAIN: Wait = at_most(5);

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let bus = shell.bus;
    let commands = HAND_COMMAND.get(bus)?;
    let mut releases = HAND_RELEASE.new_packets(bus)?;
    let send = sender!(bus, HandOutputs { openings => HAND_OPEN, targets => HAND_TARGET });
    let mut relay = HandRelay::default();
    let mut told = Vec::new();
    let times = shell.repeat(200, |times| {
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
        send(relay.step(now_ns(), &inputs))
    })?;
    Ok(times.report(commands.lost() + releases.lost()))
}
