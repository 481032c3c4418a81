//! Results of a run.

use std::collections::BTreeMap;

use serde::Serialize;
use tactnet_catching_packets::packets::CatchOutcome;
use tactnet_catching_roles::{CatchTimes, Milliseconds, RoleReport};

use crate::held_report::HeardHold;
use crate::world_role::WorldReport;
use crate::{CatchCounts, HeldReport, PairReport, ThrowBackReport};

/// Packets that the report summarises.
#[derive(Debug, Default)]
pub(crate) struct HeardCatches {
    pub outcomes: Vec<CatchOutcome>,
    pub no_plans: u64,
    pub times: CatchTimes,
    pub hold: HeardHold,
    pub brakes: BTreeMap<String, u64>,
    refused: u64,
    refused_now: u64,
    refusals: BTreeMap<String, u64>,
}

impl HeardCatches {
    /// Records the controller's count of refused paths and its last reason. A restarted controller counts from 0.
    pub fn refused(&mut self, count: u64, why: &str) {
        if count < self.refused_now {
            self.refused_now = 0;
        }
        let new = count - self.refused_now;
        if new > 0 {
            // Lateness is removed from the reason, so that late paths count under one entry.
            let why = if why.ends_with(" us late") {
                "a path that came late"
            } else {
                why
            };
            *self.refusals.entry(why.into()).or_default() += new;
        }
        self.refused += new;
        self.refused_now = count;
    }

    pub fn outcome(&mut self, outcome: &CatchOutcome) {
        self.outcomes.push(*outcome);
        self.times.outcome(outcome);
    }
}

/// Parts of the report that do not come from packets.
#[derive(Debug, Default)]
pub(crate) struct FinishedRun {
    pub processes: BTreeMap<String, RoleReport>,
    pub world: WorldReport,
    /// Number of processes that were restarted.
    pub restarts: u64,
    /// Duration, in s.
    pub seconds: f64,
    pub recording: Option<RecordingReport>,
}

/// Results of a run in figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Number of judged balls.
    pub balls: usize,
    /// Catches. A ball is in the catch space if an arm could have caught it.
    #[serde(flatten)]
    pub counts: CatchCounts,
    /// Number of missed balls in the catch space, by cause.
    pub misses: BTreeMap<&'static str, usize>,
    /// Statistics of throws of two balls, each counted once, as in stepped time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<PairReport>,
    /// Statistics of balls that were thrown back, if enabled.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub throw_back: Option<ThrowBackReport>,
    /// Result of the calibration check, if there is a calibration.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<HeldReport>,
    /// Number of caught balls with a predicted material.
    pub beliefs_after_catch: usize,
    /// Number of correctly predicted materials.
    pub correct_materials: usize,
    /// Mean number of sweeps per caught ball.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweeps_a_ball: Option<f64>,
    /// Time from the middle of an exposure to its first path.
    pub exposure_to_path_ms: Option<Milliseconds>,
    /// Age of the last picture behind the path of a caught ball, at the catch.
    pub last_picture_age_ms: Option<Milliseconds>,
    /// Age of the last head pose behind the path of a caught ball, at the catch: the last measurement with an
    /// inertial unit of the thesis.
    pub last_measurement_age_ms: Option<Milliseconds>,
    /// 99.9th percentile of the time from the start of a controller cycle to its command, in µs.
    pub loop_p999_us: f64,
    /// Number of stops by the safety monitor, including those that were only reported.
    pub monitor_brakes: u64,
    /// Number of false stops among them.
    pub false_brakes: u64,
    /// Number of brakings, by reason.
    pub brakes: BTreeMap<String, u64>,
    /// Number of paths that the controller refused.
    pub paths_refused: u64,
    /// Number of refused paths, by reason, as far as the reasons were received.
    pub refusals: BTreeMap<String, u64>,
    /// Number of plan requests without a result.
    pub no_plans: u64,
    /// Number of processes that ended by themselves and were restarted.
    pub restarts: u64,
    /// Duration of the run, in s.
    pub seconds: f64,
    /// Statistics of each process.
    pub processes: BTreeMap<String, RoleReport>,
    /// Statistics of the world.
    pub world: WorldReport,
    /// Statistics of the recording, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingReport>,
}

impl RunReport {
    pub(crate) fn of(heard: &HeardCatches, run: FinishedRun) -> Self {
        let balls = heard.outcomes.iter();
        let balls: Vec<_> = balls
            .map(|ball| [ball.arms != 0, ball.caught == 1])
            .collect();
        let mut misses = BTreeMap::new();
        let missed = |outcome: &&CatchOutcome| outcome.arms != 0 && outcome.caught == 0;
        for outcome in heard.outcomes.iter().filter(missed) {
            *misses.entry(cause(outcome.cause)).or_default() += 1;
        }
        let is_felt = |outcome: &&CatchOutcome| !outcome.felt.as_str().is_empty();
        let felt: Vec<&CatchOutcome> = heard.outcomes.iter().filter(is_felt).collect();
        let sweeps: u32 = felt.iter().map(|outcome| outcome.sweeps).sum();
        let of = |name: &str| run.processes.get(name).cloned().unwrap_or_default();
        let safety = of("safety");
        Self {
            balls: heard.outcomes.len(),
            counts: CatchCounts::of(&balls),
            misses,
            pairs: PairReport::of(&heard.outcomes),
            throw_back: None,
            calibration: heard.hold.report(),
            beliefs_after_catch: felt.len(),
            correct_materials: felt.iter().filter(|of| of.felt == of.material).count(),
            sweeps_a_ball: (!felt.is_empty()).then(|| sweeps as f64 / felt.len() as f64),
            exposure_to_path_ms: Milliseconds::of(&heard.times.exposure_to_path_ms),
            last_picture_age_ms: Milliseconds::of(&heard.times.picture_age_ms),
            last_measurement_age_ms: Milliseconds::of(&heard.times.head_age_ms),
            loop_p999_us: of("controller").p999_us,
            monitor_brakes: safety.brakes,
            false_brakes: safety.brakes_in_vain,
            brakes: heard.brakes.clone(),
            paths_refused: heard.refused,
            refusals: heard.refusals.clone(),
            no_plans: heard.no_plans,
            restarts: run.restarts,
            seconds: run.seconds,
            processes: run.processes,
            world: run.world,
            recording: run.recording,
        }
    }
}

/// Statistics of a recording of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct RecordingReport {
    /// Number of recorded packets.
    pub messages: u64,
    /// Number of packets that were published but not received.
    pub lost: u64,
    /// Reason of an early end, for example a full disk.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broke_off: Option<String>,
}

/// Returns the cause of a miss in words.
pub fn cause(number: u32) -> &'static str {
    match number {
        0 => "caught",
        1 => "never came near",
        2 => "no closing commanded",
        3 => "across",
        4 => "angle",
        5 => "closed too early",
        6 => "closed too late",
        _ => "unknown",
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use tactnet_catching_packets::packets::{ArmPath, Text};

    use super::*;

    fn outcome(caught: u32, cause: u32, arms: u32, crossing_ns: u64) -> CatchOutcome {
        CatchOutcome {
            caught,
            cause,
            arms,
            arm: 1,
            crossing_ns,
            ..CatchOutcome::zeroed()
        }
    }

    fn report(catches: &HeardCatches) -> RunReport {
        RunReport::of(catches, FinishedRun::default())
    }

    #[test]
    fn rates_are_of_the_catch_space_and_materials_of_all_caught_balls() {
        let mut catches = HeardCatches::default();
        catches.outcome(&CatchOutcome {
            material: Text::new("cork"),
            felt: Text::new("cork"),
            sweeps: 2,
            ..outcome(1, 0, 2, 1_150_000_000)
        });
        catches.outcome(&outcome(0, 3, 1, 9_150_000_000));
        catches.outcome(&outcome(0, 1, 0, 0));
        catches.outcome(&CatchOutcome {
            material: Text::new("cork"),
            felt: Text::new("felt"),
            sweeps: 3,
            ..outcome(1, 0, 0, 19_150_000_000)
        });
        let report = report(&catches);
        assert_eq!((report.balls, report.counts.catchable), (4, 2));
        assert_eq!((report.counts.caught, report.counts.caught_of_all), (1, 2));
        assert_eq!(report.misses, [("across", 1)].into());
        let materials = (report.beliefs_after_catch, report.correct_materials);
        assert_eq!(materials, (2, 1));
        assert_eq!(report.sweeps_a_ball, Some(2.5));
    }

    #[test]
    fn ages_are_of_the_path_that_was_followed() {
        let mut catches = HeardCatches::default();
        let path = |arm: u64, start_ns: u64| ArmPath {
            arm,
            start_ns,
            exposure_ns: start_ns - 70_000_000,
            head_ns: start_ns - 16_000_000,
            ..ArmPath::zeroed()
        };
        let times = &mut catches.times;
        times.path(1_055_000_000, &path(1, 1_060_000_000));
        times.path(1_095_000_000, &path(1, 1_100_000_000));
        // Correction from the same picture.
        let mut corrected = path(1, 1_116_000_000);
        corrected.exposure_ns = 1_030_000_000;
        times.path(1_111_000_000, &corrected);
        catches.outcome(&outcome(1, 0, 2, 1_150_000_000));
        catches.outcome(&outcome(0, 3, 1, 9_150_000_000));
        catches.outcome(&outcome(0, 1, 0, 0));
        catches.outcome(&outcome(1, 0, 0, 19_150_000_000));
        let report = report(&catches);
        let count_and_max = |ms: Option<Milliseconds>| ms.map(|ms| (ms.count, ms.max));
        let first_path = count_and_max(report.exposure_to_path_ms);
        assert_eq!(first_path, Some((2, 65.0)));
        let picture = count_and_max(report.last_picture_age_ms);
        assert_eq!(picture, Some((1, 120.0)));
        assert_eq!(report.last_measurement_age_ms.map(|ms| ms.p50), Some(50.0));
    }

    #[test]
    fn refusals_are_counted_by_reason_and_controllers_begin_again() {
        let mut catches = HeardCatches::default();
        catches.refused(2, "a path that came 12 us late");
        catches.refused(3, "a path that came 345 us late");
        catches.refused(1, "a path of no arm");
        let report = report(&catches);
        assert_eq!(report.paths_refused, 4);
        let refusals = [("a path of no arm", 1), ("a path that came late", 3)];
        let refusals = refusals.map(|(why, n)| (why.to_owned(), n));
        assert_eq!(report.refusals, refusals.into());
    }
}
