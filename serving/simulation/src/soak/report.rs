//! Report of a soak test.

use serde::Serialize;
#[cfg(feature = "catching")]
use tactnet_catching_stage::RunReport;
use tactnet_channel::percentile;
use tactnet_serving::ServeReport;
use tactnet_skin::packets::Stage;

use super::Soak;
use crate::company::CompanyReport;
use crate::{LoopTimes, Scheduling};

/// Upper bounds of the histogram buckets, in µs.
const BOUNDS_US: [f64; 10] = [
    300.0, 400.0, 500.0, 600.0, 800.0, 1000.0, 1333.0, 2000.0, 4000.0, 8000.0,
];

/// Result of a soak test, as a JSON document.
#[derive(Debug, Clone, Serialize)]
pub struct SoakReport {
    /// Version of the document: 1.
    pub schema_version: u32,
    /// Commit of the program.
    pub git: &'static str,
    /// Time with the classifier, in s.
    pub seconds: f64,
    /// Scheduling of the processes.
    pub scheduling: Scheduling,
    /// Number of frames between the first and the last received frame, over all windows with the classifier.
    pub frames_sent: u64,
    /// Number of lost frames among them.
    pub frames_lost: u64,
    /// Number of complete sweeps.
    pub sweeps: u64,
    /// Number of rejected sweeps.
    pub rejected: u64,
    /// Number of complete sweeps whose most probable material was correct.
    pub correct: u64,
    /// Number of complete sweeps with a known material.
    #[serde(rename = "judged")]
    pub evaluated: u64,
    /// Number of beliefs sent.
    pub beliefs: u64,
    /// Median delay from a sweep's last frame to its plain belief, in µs.
    pub belief_latency_p50_us: f64,
    /// 99th percentile of that delay, in µs.
    pub belief_latency_p99_us: f64,
    /// Maximum of that delay, in µs.
    pub belief_latency_max_us: f64,
    /// Median delay from a sweep's last frame to its Monte Carlo belief, in µs.
    pub dropout_latency_p50_us: f64,
    /// 99th percentile of that delay, in µs.
    pub dropout_latency_p99_us: f64,
    /// Maximum of that delay, in µs.
    pub dropout_latency_max_us: f64,
    /// Median delay of beliefs during a sweep, in µs.
    pub anytime_latency_p50_us: f64,
    /// 99th percentile of that delay, in µs.
    pub anytime_latency_p99_us: f64,
    /// Number of allocations of the classifier's thread per frame.
    pub allocations_per_frame: f64,
    /// Number of predictions that missed their deadline.
    pub deadline_misses: u64,
    /// Maximum time from the sending of a frame to the end of its processing, in µs.
    pub worst_delay_us: f64,
    /// Statistics of the 1 kHz loop with the classifier and the dashboard.
    pub loop_with: LoopTimes,
    /// Statistics of the 1 kHz loop without them.
    pub loop_without: LoopTimes,
    /// Number of packets of the company that were lost, over the whole test.
    pub stack_lost: u64,
    /// Ratio of the loop's 99th percentile with the classifier and the dashboard to the one without.
    pub loop_p99_ratio: f64,
    /// Median of that ratio over the turns, which is less sensitive to bursts of other work on the machine.
    pub loop_p99_ratio_of_turns: f64,
    /// Cumulative histogram of the plain beliefs' latency.
    pub histogram: Vec<LatencyBucket>,
    /// Report of the catching stack, if it ran.
    #[cfg(feature = "catching")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub catching: Option<RunReport>,
}

/// Number of plain beliefs within a latency bound.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct LatencyBucket {
    /// Upper bound in µs; `null` in JSON for the last, unbounded bucket.
    pub below_us: f64,
    /// Number of beliefs.
    pub beliefs: usize,
}

/// Received beliefs, compared with the played materials.
#[derive(Debug, Default)]
pub(super) struct HeardBeliefs {
    /// Latencies in µs, by stage.
    pub(super) latency_us: [Vec<f64>; 3],
    pub(super) evaluated: u64,
    pub(super) correct: u64,
}

/// Measurements of a soak test.
pub(super) struct Measured {
    pub(super) company: CompanyReport,
    /// Report of each classifier process.
    pub(super) served: Vec<ServeReport>,
    pub(super) heard: HeardBeliefs,
    /// Start and end of each window with the classifier, in ns.
    pub(super) with: Vec<(u64, u64)>,
    pub(super) without: Vec<(u64, u64)>,
}

impl Measured {
    pub(super) fn report(mut self, soak: &Soak<'_>) -> SoakReport {
        let sum = |count: fn(&ServeReport) -> u64| self.served.iter().map(count).sum::<u64>();
        let frames = sum(|served| served.frames);
        let frames_sent = sum(|served| served.frames_sent(0));
        let ratio_of = |(with, without): (&(u64, u64), &(u64, u64))| {
            let trips = &self.company.trips;
            LoopTimes::of(trips, &[*with]).p99_us / LoopTimes::of(trips, &[*without]).p99_us
        };
        let turns = self.with.iter().zip(&self.without);
        let mut ratios: Vec<f64> = turns.map(ratio_of).collect();
        ratios.sort_by(f64::total_cmp);
        let loop_with = LoopTimes::of(&self.company.trips, &self.with);
        let loop_without = LoopTimes::of(&self.company.trips, &self.without);
        for latencies in &mut self.heard.latency_us {
            latencies.sort_by(f64::total_cmp);
        }
        let latency_us = &self.heard.latency_us;
        let at =
            |stage: Stage, share| percentile(&latency_us[stage as usize - 1], share).unwrap_or(0.0);
        let windows = self.with.iter();
        let seconds = windows.map(|(from, to)| (to - from) as f64 / 1e9).sum();
        SoakReport {
            schema_version: 1,
            git: soak.git,
            seconds,
            scheduling: soak.scheduling,
            frames_sent,
            frames_lost: frames_sent.saturating_sub(frames),
            sweeps: sum(|served| served.sweeps),
            rejected: sum(|served| served.rejected),
            correct: self.heard.correct,
            evaluated: self.heard.evaluated,
            beliefs: sum(|served| served.beliefs),
            belief_latency_p50_us: at(Stage::Plain, 0.5),
            belief_latency_p99_us: at(Stage::Plain, 0.99),
            belief_latency_max_us: at(Stage::Plain, 1.0),
            dropout_latency_p50_us: at(Stage::Dropout, 0.5),
            dropout_latency_p99_us: at(Stage::Dropout, 0.99),
            dropout_latency_max_us: at(Stage::Dropout, 1.0),
            anytime_latency_p50_us: at(Stage::Anytime, 0.5),
            anytime_latency_p99_us: at(Stage::Anytime, 0.99),
            allocations_per_frame: sum(|served| served.allocations) as f64 / frames.max(1) as f64,
            deadline_misses: sum(|served| served.deadline_misses),
            worst_delay_us: self
                .served
                .iter()
                .map(|served| served.worst_delay_us)
                .fold(0.0, f64::max),
            loop_p99_ratio: loop_with.p99_us / loop_without.p99_us,
            loop_p99_ratio_of_turns: percentile(&ratios, 0.5).unwrap_or(f64::NAN),
            loop_with,
            loop_without,
            stack_lost: self.company.lost,
            histogram: histogram(&latency_us[Stage::Plain as usize - 1]),
            #[cfg(feature = "catching")]
            catching: self.company.catching,
        }
    }
}

/// Returns the cumulative histogram.
///
/// - `latency_us`: sorted in ascending order
fn histogram(latency_us: &[f64]) -> Vec<LatencyBucket> {
    BOUNDS_US
        .iter()
        .map(|bound| LatencyBucket {
            below_us: *bound,
            beliefs: latency_us.partition_point(|latency| latency <= bound),
        })
        .chain([LatencyBucket {
            below_us: f64::INFINITY,
            beliefs: latency_us.len(),
        }])
        .collect()
}
