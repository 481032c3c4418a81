//! Closing of the hands.
//!
//! A hand starts to close [`CLOSING_NS`] before its fingers enclose the ball. From then on, later commands are
//! ignored until it opens again. A late command closes the hand as soon as possible.

use tactnet_catching_packets::packets::HandCommand;

/// Time from the start of closing until the fingers enclose the ball, in ns.
pub const CLOSING_NS: u64 = 10_000_000;
/// Time for which a hand stays closed, in ns.
pub const CLOSED_NS: u64 = 200_000_000;

#[derive(Debug, Clone)]
pub(crate) struct Hand {
    arm: u64,
    /// Commanded time at which the hand encloses the ball, in ns; valid until the hand opens again.
    pub(crate) closes_ns: Option<u64>,
    /// Number of commands for another arm or for a time in the past.
    pub(crate) ignored: u64,
}

impl Hand {
    pub(crate) fn new(arm: usize) -> Self {
        Self {
            arm: arm as u64,
            closes_ns: None,
            ignored: 0,
        }
    }

    /// Takes a command at `now_ns`; `None` changes nothing.
    pub(crate) fn receive(&mut self, now_ns: u64, command: Option<&HandCommand>) {
        self.closes_ns
            .take_if(|closes| now_ns >= *closes + CLOSED_NS);
        let Some(command) = command else {
            return;
        };
        let committed = self
            .closes_ns
            .is_some_and(|closes| now_ns + CLOSING_NS >= closes);
        if command.arm != self.arm || command.catch_ns < now_ns {
            self.ignored += 1;
        } else if !committed {
            self.closes_ns = Some(command.catch_ns.max(now_ns + CLOSING_NS));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    fn command(catch_ns: u64) -> HandCommand {
        HandCommand { arm: 0, catch_ns }
    }

    #[test]
    fn the_last_command_before_closing_counts() {
        let mut hand = Hand::new(0);
        hand.receive(0, Some(&command(500 * MS)));
        hand.receive(480 * MS, Some(&command(505 * MS)));
        assert_eq!(hand.closes_ns, Some(505 * MS));
        hand.receive(495 * MS, Some(&command(502 * MS)));
        assert_eq!(hand.closes_ns, Some(505 * MS), "committed");
        hand.receive(704 * MS, None);
        assert_eq!(hand.closes_ns, Some(505 * MS));
        hand.receive(705 * MS, None);
        assert_eq!(hand.closes_ns, None, "open again");
    }

    #[test]
    fn a_command_that_comes_late_closes_late() {
        let mut hand = Hand::new(0);
        hand.receive(496 * MS, Some(&command(500 * MS)));
        assert_eq!(hand.closes_ns, Some(506 * MS));
        hand.receive(497 * MS, Some(&command(900 * MS)));
        assert_eq!(hand.closes_ns, Some(506 * MS), "committed");
    }

    /// Commands that always ask for a closing in 10 ms close the hand once, by the first command.
    #[test]
    fn closing_cannot_be_put_off_while_it_goes_on() {
        let mut hand = Hand::new(0);
        for ms in 100..200 {
            hand.receive(ms * MS, Some(&command(ms * MS + CLOSING_NS)));
        }
        assert_eq!(hand.closes_ns, Some(110 * MS));
    }

    #[test]
    fn commands_for_the_past_or_another_arm_are_ignored() {
        let mut hand = Hand::new(1);
        hand.receive(100 * MS, Some(&command(200 * MS)));
        let past = HandCommand {
            arm: 1,
            catch_ns: 99 * MS,
        };
        hand.receive(100 * MS, Some(&past));
        assert_eq!((hand.closes_ns, hand.ignored), (None, 2));
    }
}
