//! Forwards valid closing times and releases to the hands.

use std::time::Duration;

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{HandCommand, HandOpening};
use tactnet_channel::{Bus, Priority, Start, Wait, now_ns};

use crate::channels::{HAND_COMMAND, HAND_OPEN, HAND_RELEASE, HAND_TARGET};
use crate::times::Times;
use crate::{RoleError, RoleReport};

/// Maximum distance of a plausible time in the future, in ns.
const FARTHEST_NS: u64 = 3_000_000_000;
/// Period at which a closing time is repeated, so that a hand that missed it or restarted still closes.
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
    let releases = bus.get_port::<HandOpening>(HAND_RELEASE, Start::Now)?;
    let openings = bus.put_port::<HandOpening>(HAND_OPEN, Priority::RealTime)?;
    let mut times = Times::at(200);
    let mut told: [Option<HandCommand>; ARMS] = [None; ARMS];
    ready();
    while !stopped() {
        let mut next = commands.get(AGAIN)?;
        while let Some(packet) = next {
            times.push(now_ns().saturating_sub(packet.header().put_ns));
            if let Some(command) = packet
                .first()
                .filter(|command| makes_sense(command.arm, command.catch_ns, now_ns()))
            {
                told[command.arm as usize] = Some(*command);
            }
            next = commands.try_get()?;
        }
        // Releases are not repeated, so that a sender that stops cancels its release.
        while let Some(packet) = releases.try_get()? {
            if let Some(release) = packet
                .first()
                .filter(|release| makes_sense(release.arm, release.open_ns, now_ns()))
            {
                openings.put_copy(&[*release])?;
            }
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
        lost: commands.lost() + releases.lost(),
        ..times.report()
    })
}

fn makes_sense(arm: u64, at_ns: u64, now_ns: u64) -> bool {
    arm < ARMS as u64 && (now_ns..now_ns + FARTHEST_NS).contains(&at_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_near_and_of_an_arm() {
        assert!(makes_sense(1, 2_000, 1_000));
        assert!(!makes_sense(2, 2_000, 1_000));
        assert!(!makes_sense(0, 999, 1_000));
        assert!(!makes_sense(0, u64::MAX, 1_000));
    }
}
