//! Closing times, checked, to the hands.

use std::time::Duration;

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::HandCommand;
use tactnet_channel::{Bus, Priority, Start, Wait, now_ns};

use crate::channels::{HAND_COMMAND, HAND_TARGET};
use crate::times::Times;
use crate::{RoleError, RoleReport};

/// A closing time farther ahead is a mistake, ns.
const FARTHEST_NS: u64 = 3_000_000_000;
/// How often a closing time is repeated: hands that missed it, or begin again, still close.
const AGAIN: Wait = Wait::Block {
    timeout: Duration::from_millis(5),
};

pub(crate) fn run(
    bus: &Bus,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let commands = bus.get_port::<HandCommand>(HAND_COMMAND, Start::Now)?;
    let targets = bus.put_port::<HandCommand>(HAND_TARGET, Priority::RealTime)?;
    let mut times = Times::at(200);
    let mut told: [Option<HandCommand>; ARMS] = [None; ARMS];
    ready();
    while !stopped() {
        let mut next = commands.get(AGAIN)?;
        while let Some(packet) = next {
            times.push(now_ns().saturating_sub(packet.header().put_ns));
            if let Some(command) = packet
                .first()
                .filter(|command| makes_sense(command, now_ns()))
            {
                told[command.arm as usize] = Some(*command);
            }
            next = commands.try_get()?;
        }
        for target in &mut told {
            if target
                .take_if(|target| target.catch_ns < now_ns())
                .is_some()
            {
                continue;
            }
            if let Some(target) = target {
                targets.put_copy(&[*target])?;
            }
        }
    }
    Ok(RoleReport {
        lost: commands.lost(),
        ..times.report()
    })
}

fn makes_sense(command: &HandCommand, now_ns: u64) -> bool {
    command.arm < ARMS as u64 && (now_ns..now_ns + FARTHEST_NS).contains(&command.catch_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closing_times_are_near_and_of_an_arm() {
        let command = |arm, catch_ns| HandCommand { arm, catch_ns };
        assert!(makes_sense(&command(1, 2_000), 1_000));
        assert!(!makes_sense(&command(2, 2_000), 1_000));
        assert!(!makes_sense(&command(0, 999), 1_000));
        assert!(!makes_sense(&command(0, u64::MAX), 1_000));
    }
}
