//! Computation times of a process.

use serde::{Deserialize, Serialize};
use tactnet_channel::{now_ns, percentile};

/// Maximum number of stored times, an hour at 1 kHz. Later ones are only counted.
const MOST: usize = 3_600_000;

/// Computation times of one process.
#[derive(Debug, Clone, Default)]
pub struct Times {
    ns: Vec<u32>,
    count: u64,
}

impl Times {
    /// Reserves memory for an hour at the given rate.
    pub fn at(rate_hz: usize) -> Self {
        Self {
            ns: Vec::with_capacity((rate_hz * 3600).min(MOST)),
            count: 0,
        }
    }

    pub(crate) fn push(&mut self, ns: u64) {
        self.count += 1;
        if self.ns.len() < self.ns.capacity() {
            self.ns.push(ns.min(u64::from(u32::MAX)) as u32);
        }
    }

    /// Adds the time since `begun_ns` if the process had something to do.
    pub(crate) fn push_since(&mut self, begun_ns: u64, busy: bool) {
        if busy {
            self.push(now_ns().saturating_sub(begun_ns));
        }
    }

    /// Returns the statistics.
    ///
    /// - `lost`: number of packets that the process lost
    pub(crate) fn report(mut self, lost: u64) -> RoleReport {
        self.ns.sort_unstable();
        let at = |share| percentile(&self.ns, share).map_or(0.0, |ns| f64::from(ns) / 1e3);
        RoleReport {
            count: self.count,
            p50_us: at(0.5),
            p99_us: at(0.99),
            p999_us: at(0.999),
            max_us: at(1.0),
            lost,
            ..RoleReport::default()
        }
    }
}

/// Statistics of a process.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoleReport {
    /// Number of cycles of the controller, verdicts, plans, or pairs of pictures.
    pub count: u64,
    /// Median computation time, in µs; for the controller from the start of a cycle to its command.
    pub p50_us: f64,
    /// 99th percentile, in µs.
    pub p99_us: f64,
    /// 99.9th percentile, in µs.
    pub p999_us: f64,
    /// Maximum, in µs.
    pub max_us: f64,
    /// Number of packets that were published but not received.
    pub lost: u64,
    /// Number of transitions of the monitor to its stop verdict while the robot moved.
    pub brakes: u64,
    /// Number of false stops: stops after which the bodies would not have touched.
    pub brakes_in_vain: u64,
}

impl RoleReport {
    /// Returns the report of two threads that do the same work: the times of the slower one.
    pub(crate) fn with(self, other: Self) -> Self {
        let (count, lost) = (self.count + other.count, self.lost + other.lost);
        let slower = if other.p99_us > self.p99_us {
            other
        } else {
            self
        };
        Self {
            count,
            lost,
            ..slower
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_of_what_was_pushed() {
        let mut times = Times::at(1);
        (1..=1000).for_each(|ns| times.push(ns * 1000));
        let report = times.report(0);
        assert_eq!(report.count, 1000);
        assert_eq!([report.p50_us, report.max_us], [500.0, 1000.0]);
        assert_eq!(Times::at(1).report(0), RoleReport::default());
    }
}
