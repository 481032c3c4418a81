//! At most so many packets a second.

use std::time::{Duration, Instant};

/// Lets packets pass at a rate, and as many at once as come in a tenth of a second at that rate.
#[derive(Debug)]
pub struct RateLimit {
    /// Time that one packet takes.
    each: Duration,
    /// Time that packets may be ahead.
    ahead: Duration,
    /// When the packets so far would have come at the rate.
    due: Option<Instant>,
}

impl RateLimit {
    /// Begins to count.
    ///
    /// - `rate`: packets a second, above 0
    pub fn new(rate: u32) -> Self {
        let each = Duration::from_secs(1) / rate.max(1);
        Self {
            each,
            ahead: (each * (rate / 10)).max(each),
            due: None,
        }
    }

    /// Counts a packet that comes at `now`; returns false for one too many.
    pub fn allows(&mut self, now: Instant) -> bool {
        let due = self.due.unwrap_or(now).max(now);
        if due > now + self.ahead {
            return false;
        }
        self.due = Some(due + self.each);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_steady_rate_passes_and_a_flood_does_not() {
        let begun = Instant::now();
        let passed = |rate: u32, every: Duration, packets: u32| {
            let mut limit = RateLimit::new(rate);
            (0..packets)
                .filter(|packet| limit.allows(begun + every * *packet))
                .count()
        };
        assert_eq!(passed(1000, Duration::from_millis(1), 5000), 5000);
        // A second of a flood, ten times too fast: the rate, and a tenth of a second more.
        let flood = passed(1000, Duration::from_micros(100), 10_000);
        assert!((1000..=1102).contains(&flood), "{flood}");
        assert_eq!(passed(1, Duration::ZERO, 10), 2, "one, and one ahead");
    }
}
