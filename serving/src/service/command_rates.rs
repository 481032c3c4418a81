//! Rate limit on commands, for each put-port.

use std::time::Instant;

use tactnet_channel::RateLimit;

/// Maximum rate of commands of one put-port, in Hz. It keeps a flood of commands from delaying frames and other commands.
pub(super) const COMMAND_RATE: u32 = 1000;
/// Maximum number of put-ports with their own limit; further ones replace the oldest.
const PUTTERS: usize = 16;

/// Rate limits of the most recent put-ports.
pub(super) struct CommandRates {
    /// Put-port number and its limit.
    limits: Vec<(u64, RateLimit)>,
    next: usize,
}

impl CommandRates {
    pub(super) fn new() -> Self {
        Self {
            limits: Vec::with_capacity(PUTTERS),
            next: 0,
        }
    }

    /// Counts a command of a put-port; returns false if it exceeds the limit. Does not allocate.
    pub(super) fn allow(&mut self, putter: u64, now: Instant) -> bool {
        if let Some((_, limit)) = self.limits.iter_mut().find(|(known, _)| *known == putter) {
            return limit.allows(now);
        }
        let mut limit = RateLimit::new(COMMAND_RATE);
        let allowed = limit.allows(now);
        if self.limits.len() < PUTTERS {
            self.limits.push((putter, limit));
        } else {
            self.limits[self.next] = (putter, limit);
            self.next = (self.next + 1) % PUTTERS;
        }
        allowed
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_costs_nobody_else_a_command() {
        let (mut rates, now) = (CommandRates::new(), Instant::now());
        let followed = (0..10_000).filter(|_| rates.allow(1, now)).count();
        assert!(followed < 200, "{followed}");
        assert!((2..40).all(|putter| rates.allow(putter, now)));
        assert_eq!(rates.limits.len(), PUTTERS);
    }
}
