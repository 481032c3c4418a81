//! Periodic timer.

use crate::now_ns;

/// Sleeps until the next tick of a fixed period of the host's monotonic clock, without drift.
///
/// ```
/// use tactnet_channel::{Ticker, now_ns};
///
/// let begun = now_ns();
/// let mut ticker = Ticker::new(1000.0);
/// for _ in 0..3 {
///     ticker.wait();
/// }
/// assert!(now_ns() - begun >= 2_000_000);
/// ```
#[derive(Debug)]
pub struct Ticker {
    period_ns: f64,
    begun_ns: u64,
    beats: u64,
}

impl Ticker {
    /// Creates a ticker with `rate_hz` ticks per second, from now on.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            period_ns: 1e9 / rate_hz,
            begun_ns: now_ns(),
            beats: 0,
        }
    }

    /// Creates a ticker with ticks at whole multiples of the period of the monotonic clock, plus `after_ns`.
    ///
    /// Processes of a host with the same rate tick together.
    pub fn aligned(rate_hz: f64, after_ns: u64) -> Self {
        let period_ns = 1e9 / rate_hz;
        let whole = (now_ns() as f64 / period_ns).ceil();
        Self {
            period_ns,
            begun_ns: (whole * period_ns) as u64 + after_ns,
            beats: 0,
        }
    }

    /// Returns the time of the next tick, in nanoseconds of the host's monotonic clock.
    pub fn next_ns(&self) -> u64 {
        self.begun_ns + ((self.beats + 1) as f64 * self.period_ns) as u64
    }

    /// Waits for the next tick. Returns the delay with which it was noticed, in nanoseconds.
    pub fn wait(&mut self) -> u64 {
        let due = self.next_ns();
        self.beats += 1;
        let time = libc::timespec {
            tv_sec: (due / 1_000_000_000) as libc::time_t,
            tv_nsec: (due % 1_000_000_000) as libc::c_long,
        };
        loop {
            // SAFETY: a valid clock and time; nothing is written.
            let failed = unsafe {
                libc::clock_nanosleep(
                    libc::CLOCK_MONOTONIC,
                    libc::TIMER_ABSTIME,
                    &raw const time,
                    std::ptr::null_mut(),
                )
            };
            if failed != libc::EINTR {
                return now_ns().saturating_sub(due);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aligned_beats_are_those_of_every_process() {
        for after in [0, 500_000] {
            let mut ticker = Ticker::aligned(1000.0, after);
            for _ in 0..3 {
                assert_eq!(ticker.next_ns() % 1_000_000, after);
                ticker.wait();
            }
        }
    }

    #[test]
    fn beats_do_not_drift() {
        let begun = now_ns();
        let mut ticker = Ticker::new(1000.0);
        for _ in 0..50 {
            ticker.wait();
        }
        let taken = now_ns() - begun;
        assert!(taken >= 50_000_000, "{taken}");
    }
}
