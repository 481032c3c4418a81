//! Commands to the hands: repeats closing times until they are over, and forwards releases once.

use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{HandCommand, HandOpening};

/// Maximum distance of a plausible time in the future, in ns.
const FARTHEST_NS: u64 = 3_000_000_000;

/// Inputs of one step: the packets since the last one.
#[derive(Debug, Clone, Copy, Default)]
pub struct HandInputs<'a> {
    /// Closing times.
    pub commands: &'a [HandCommand],
    /// Releases.
    pub releases: &'a [HandOpening],
}

/// Packets that one step sends to the left and the right hand.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct HandOutputs {
    /// Closing times, in every step, so that a hand that missed one or restarted still closes.
    pub targets: [Option<HandCommand>; ARMS],
    /// Releases. They are not repeated, so that a sender that stops cancels its release.
    pub openings: [Option<HandOpening>; ARMS],
}

/// Relay of commands to the hands.
#[derive(Debug, Clone, Default)]
pub struct HandRelay {
    told: [Option<HandCommand>; ARMS],
}

impl HandRelay {
    /// Returns the packets to send. Times that are past, or implausibly far away, are dropped.
    pub fn step(&mut self, now_ns: u64, inputs: &HandInputs<'_>) -> HandOutputs {
        let near = |at_ns: u64| (now_ns..now_ns + FARTHEST_NS).contains(&at_ns);
        let mut outputs = HandOutputs::default();
        for command in inputs.commands.iter().filter(|one| near(one.catch_ns)) {
            if let Some(told) = self.told.get_mut(command.arm as usize) {
                *told = Some(*command);
            }
        }
        for release in inputs.releases.iter().filter(|one| near(one.open_ns)) {
            if let Some(opening) = outputs.openings.get_mut(release.arm as usize) {
                *opening = Some(*release);
            }
        }
        self.told = self.told.map(|told| told.filter(|one| near(one.catch_ns)));
        outputs.targets = self.told;
        outputs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_closing_time_is_repeated_until_it_is_over_and_a_newer_one_replaces_it() {
        let mut relay = HandRelay::default();
        let close = |catch_ns: u64| HandCommand { arm: 1, catch_ns };
        let both = HandInputs {
            commands: &[close(2_000), close(1_500)],
            ..HandInputs::default()
        };
        let told = [None, Some(close(1_500))];
        assert_eq!(relay.step(1_000, &both).targets, told);
        assert_eq!(relay.step(1_500, &HandInputs::default()).targets, told);
        assert_eq!(
            relay.step(1_501, &HandInputs::default()),
            HandOutputs::default()
        );
    }

    #[test]
    fn a_release_is_sent_once_and_what_makes_no_sense_never() {
        let mut relay = HandRelay::default();
        let open = |arm: u64, open_ns: u64| HandOpening { arm, open_ns };
        let inputs = HandInputs {
            commands: &[HandCommand {
                arm: 0,
                catch_ns: u64::MAX,
            }],
            releases: &[open(0, 2_000), open(2, 2_000), open(1, 999)],
        };
        let outputs = relay.step(1_000, &inputs);
        assert_eq!(outputs.openings, [Some(open(0, 2_000)), None]);
        assert_eq!(outputs.targets, [None; ARMS]);
        assert_eq!(
            relay.step(1_001, &HandInputs::default()),
            HandOutputs::default()
        );
    }
}
