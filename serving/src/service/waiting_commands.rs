//! Commands that wait for the frame that follows them.

use std::collections::VecDeque;

use tactnet_skin::packets::SweepCommand;

/// Maximum number of commands waiting for one finger, and for invalid fingers together.
pub(super) const MAX_COMMANDS: usize = 32;

/// Waiting commands, ordered by the time at which they were sent.
pub(super) struct WaitingCommands {
    /// Time of sending, in ns, and the command.
    waiting: VecDeque<(u64, SweepCommand)>,
    fingers: usize,
}

impl WaitingCommands {
    pub(super) fn new(fingers: usize) -> Self {
        Self {
            waiting: VecDeque::with_capacity(MAX_COMMANDS * (fingers + 1)),
            fingers,
        }
    }

    /// Adds a command sent at `put_ns`; returns false if too many wait for its finger, for example an unplugged one.
    /// Each finger has its own limit. Commands of several senders may arrive out of order.
    pub(super) fn add(&mut self, put_ns: u64, command: SweepCommand) -> bool {
        let finger = |command: &SweepCommand| (command.finger as usize).min(self.fingers);
        let waiting = self.waiting.iter();
        let own = waiting.filter(|(_, other)| finger(other) == finger(&command));
        if own.count() == MAX_COMMANDS {
            return false;
        }
        let at = self.waiting.partition_point(|(other, _)| *other <= put_ns);
        self.waiting.insert(at, (put_ns, command));
        true
    }

    /// Removes and returns the earliest command sent up to `until_ns`.
    ///
    /// - `finger`: restricts the result to this finger and to invalid fingers; `None` allows any
    pub(super) fn take(&mut self, until_ns: u64, finger: Option<usize>) -> Option<SweepCommand> {
        let at = self
            .waiting
            .iter()
            .take_while(|(put_ns, _)| *put_ns <= until_ns)
            .position(|(_, command)| {
                let other = command.finger as usize;
                finger.is_none_or(|own| own == other || other >= self.fingers)
            })?;
        self.waiting.remove(at).map(|(_, command)| command)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_skin::packets::Command;

    fn command(finger: u32, motion: u64) -> SweepCommand {
        SweepCommand {
            kind: Command::Start as u32,
            finger,
            motion,
            ..bytemuck::Zeroable::zeroed()
        }
    }

    fn motions(waiting: &mut WaitingCommands, until_ns: u64, finger: Option<usize>) -> Vec<u64> {
        std::iter::from_fn(|| waiting.take(until_ns, finger).map(|command| command.motion))
            .collect()
    }

    #[test]
    fn commands_of_two_commanders_are_followed_in_the_order_they_were_put() {
        let mut waiting = WaitingCommands::new(2);
        for (put_ns, motion) in [(30, 3), (10, 1), (20, 2), (20, 22)] {
            assert!(waiting.add(put_ns, command(0, motion)));
        }
        assert!(motions(&mut waiting, 9, None).is_empty());
        // Commands with equal times keep their order of arrival.
        assert_eq!(motions(&mut waiting, 20, None), [1, 2, 22]);
        assert_eq!(motions(&mut waiting, u64::MAX, None), [3]);
    }

    #[test]
    fn a_frame_lets_only_commands_of_its_own_finger_and_of_none_go_ahead() {
        let mut waiting = WaitingCommands::new(2);
        for (put_ns, finger) in [(1, 1), (2, 0), (3, 7), (4, 1), (5, 0)] {
            assert!(waiting.add(put_ns, command(finger, put_ns)));
        }
        assert_eq!(motions(&mut waiting, 4, Some(0)), [2, 3]);
        assert_eq!(motions(&mut waiting, 4, Some(1)), [1, 4]);
        assert_eq!(motions(&mut waiting, u64::MAX, None), [5]);
    }

    #[test]
    fn one_too_many_is_refused_and_changes_nothing() {
        let mut waiting = WaitingCommands::new(1);
        for motion in 0..MAX_COMMANDS as u64 {
            assert!(waiting.add(motion, command(0, motion)));
        }
        assert!(!waiting.add(0, command(0, 99)));
        // Commands for invalid fingers have their own limit.
        assert!(waiting.add(99, command(5, 99)));
        assert_eq!(
            motions(&mut waiting, u64::MAX, None),
            (0..MAX_COMMANDS as u64).chain([99]).collect::<Vec<_>>()
        );
    }
}
