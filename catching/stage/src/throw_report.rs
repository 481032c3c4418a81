//! Results of throwing balls back.

use std::collections::BTreeMap;

use serde::Serialize;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{ThrowStatus, ThrownBack};
use tactnet_channel::percentile;

/// Results of throwing balls back, in figures.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct ThrowBackReport {
    /// Number of judged balls that were thrown back.
    pub throws_back: usize,
    /// Distance between landing point and target, in mm.
    pub throw_miss_mm: Option<Misses>,
    /// Mean offset of the landing point from the target along x and y, for the left and the right hand, in mm.
    pub throw_beside_mm: [Option<[f64; 2]>; ARMS],
    /// Median distance from the hand to the landing point, in m.
    pub throw_length_m: Option<f64>,
    /// Delay of the release with the largest magnitude, in ms.
    pub release_off_ms: Option<f64>,
    /// Number of failed throws, by reason.
    pub throws_failed: BTreeMap<String, u64>,
}

/// Distances from landing points to targets, in mm.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Misses {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Maximum.
    pub max: f64,
}

impl Misses {
    fn of(sorted: &[f64]) -> Option<Self> {
        Some(Self {
            p50: percentile(sorted, 0.5)?,
            p95: percentile(sorted, 0.95)?,
            max: percentile(sorted, 1.0)?,
        })
    }
}

/// Received packets about throws.
#[derive(Debug, Default)]
pub(crate) struct HeardThrows {
    pub thrown: Vec<ThrownBack>,
    failed: BTreeMap<String, u64>,
    failed_now: u64,
}

impl HeardThrows {
    /// Records the thrower's status. Returns the reason if a throw has failed since the last one.
    pub fn status(&mut self, status: &ThrowStatus) -> Option<String> {
        // A restarted thrower counts from 0.
        let before = std::mem::replace(&mut self.failed_now, status.failed);
        let new = status.failed != before && status.failed > 0;
        new.then(|| {
            let why = status.reason.as_str().to_string();
            *self.failed.entry(why.clone()).or_default() += 1;
            why
        })
    }

    pub fn report(&self) -> ThrowBackReport {
        let sorted = |of: &dyn Fn(&ThrownBack) -> f64| {
            let mut values: Vec<f64> = self.thrown.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let misses = sorted(&|thrown| 1e3 * thrown.miss);
        let off = |thrown: &ThrownBack| thrown.left_ns.abs_diff(thrown.open_ns) as f64 * 1e-6;
        ThrowBackReport {
            throws_back: self.thrown.len(),
            throw_miss_mm: Misses::of(&misses),
            throw_beside_mm: std::array::from_fn(|arm| self.beside(arm as u64)),
            throw_length_m: percentile(&sorted(&|thrown| thrown.length), 0.5),
            release_off_ms: percentile(&sorted(&off), 1.0),
            throws_failed: self.failed.clone(),
        }
    }

    fn beside(&self, arm: u64) -> Option<[f64; 2]> {
        let of: Vec<&ThrownBack> = self.thrown.iter().filter(|of| of.arm == arm).collect();
        let mean = |i: usize| {
            let sum: f64 = of.iter().map(|of| of.came_down[i] - of.target[i]).sum();
            1e3 * sum / of.len() as f64
        };
        (!of.is_empty()).then(|| [mean(0), mean(1)])
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::Text;

    use super::*;

    #[test]
    fn misses_are_of_all_throws_and_averages_of_each_hand() {
        let mut heard = HeardThrows::default();
        assert_eq!(heard.report(), ThrowBackReport::default());
        for i in 1..=20 {
            heard.thrown.push(ThrownBack {
                arm: u64::from(i > 10),
                open_ns: 1_000_000_000,
                left_ns: 1_000_000_000 - 50_000 * i,
                target: [4.0, 0.0, 1.2],
                came_down: [4.0 + 0.01 * i as f64, 0.02, 1.2],
                miss: 0.01 * i as f64,
                length: 3.0,
                ..ThrownBack::zeroed()
            });
        }
        let report = heard.report();
        let misses = report.throw_miss_mm.unwrap();
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9;
        assert!(close(misses.p50, 100.0) && close(misses.p95, 190.0) && close(misses.max, 200.0));
        let [left, right] = report.throw_beside_mm.map(Option::unwrap);
        assert!(close(left[0], 55.0) && close(right[0], 155.0) && close(right[1], 20.0));
        assert_eq!((report.throws_back, report.release_off_ms), (20, Some(1.0)));
    }

    #[test]
    fn throws_that_came_to_nothing_are_counted_by_their_reason_and_throwers_begin_again() {
        let mut heard = HeardThrows::default();
        let status = |failed: u64, why: &str| ThrowStatus {
            failed,
            reason: Text::new(why),
            ..ThrowStatus::zeroed()
        };
        assert_eq!(heard.status(&status(0, "")), None);
        assert_eq!(heard.status(&status(1, "brakes")), Some("brakes".into()));
        assert_eq!(heard.status(&status(1, "brakes")), None);
        heard.status(&status(2, "out of reach"));
        heard.status(&status(0, ""));
        heard.status(&status(1, "brakes"));
        let expected = [("brakes".into(), 2), ("out of reach".into(), 1)];
        assert_eq!(heard.report().throws_failed, expected.into());
    }
}
