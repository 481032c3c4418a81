//! Limit of packets per second.

use std::time::{Duration, Instant};

/// Passes packets at a maximum rate, with bursts of a tenth of a second's packets.
#[derive(Debug)]
pub struct RateLimit {
    /// Period of the packets at the maximum rate.
    each: Duration,
    /// Maximum lead of the packets over the maximum rate.
    ahead: Duration,
    /// Time at which the packets so far would have arrived at the maximum rate.
    due: Option<Instant>,
}

impl RateLimit {
    /// Creates a limit.
    ///
    /// - `rate`: packets per second, above 0
    pub fn new(rate: u32) -> Self {
        let each = Duration::from_secs(1) / rate.max(1);
        Self {
            each,
            ahead: (each * (rate / 10)).max(each),
            due: None,
        }
    }

    /// Counts a packet that arrives at `now`. Returns false if it exceeds the limit.
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
        // One second of packets at ten times the rate: the limit plus a tenth of a second's packets pass.
        let flood = passed(1000, Duration::from_micros(100), 10_000);
        assert!((1000..=1102).contains(&flood), "{flood}");
        assert_eq!(
            passed(1, Duration::ZERO, 10),
            2,
            "one packet and a burst of one"
        );
    }
}
