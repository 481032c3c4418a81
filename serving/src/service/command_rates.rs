//! How many commands a second are followed, for each of those who put them.

use std::time::Instant;

use tactnet_channel::RateLimit;

/// Commands a second of one put-port that are followed; a flood of more keeps no frame waiting, and no command of others.
pub(super) const COMMAND_RATE: u32 = 1000;
/// Put-ports that are told apart; of more, those that came first are counted anew.
const PUTTERS: usize = 16;

/// The limits of the last putters.
pub(super) struct CommandRates {
    /// By the number of the put-port.
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

    /// Counts a command of a put-port; returns false for one too many. Does not allocate.
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
