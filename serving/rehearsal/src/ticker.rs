//! A steady beat.

use tactnet_channel::now_ns;

/// Sleeps from beat to beat of the host's monotonic clock, without drifting.
#[derive(Debug)]
pub struct Ticker {
    period_ns: f64,
    begun_ns: u64,
    beats: u64,
}

impl Ticker {
    /// Beats `rate_hz` times a second from now on.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            period_ns: 1e9 / rate_hz,
            begun_ns: now_ns(),
            beats: 0,
        }
    }

    /// Waits for the next beat; returns how late it is noticed, nanoseconds.
    pub fn wait(&mut self) -> u64 {
        self.beats += 1;
        let due = self.begun_ns + (self.beats as f64 * self.period_ns) as u64;
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
