//! What came of a run.

use std::collections::BTreeMap;

use serde::Serialize;
use tactnet_catching_packets::packets::CatchOutcome;
use tactnet_catching_roles::{CatchTimes, Milliseconds, RoleReport};
use tactnet_plot::wilson_of_counts;

use crate::held_report::HeardHold;
use crate::world_role::WorldReport;
use crate::{HeldReport, PairReport, ThrowBackReport};

/// What was heard on the channels.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    pub outcomes: Vec<CatchOutcome>,
    pub no_plans: u64,
    pub times: CatchTimes,
    pub hold: HeardHold,
    brakes: BTreeMap<String, u64>,
    refused: u64,
    refused_now: u64,
    refusals: BTreeMap<String, u64>,
}

impl Heard {
    pub fn braked(&mut self, why: &str) {
        *self.brakes.entry(why.into()).or_default() += 1;
    }

    /// Takes how many paths a controller has refused since it began, and what it said last.
    pub fn refused(&mut self, count: u64, why: &str) {
        if count < self.refused_now {
            self.refused_now = 0;
        }
        let new = count - self.refused_now;
        if new > 0 {
            // By how much each was late would make a line of each.
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

/// A run in figures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunReport {
    /// Balls thrown, with the judge's word.
    pub balls: usize,
    /// Of them, in the catch space: an arm could have caught them.
    pub catchable: usize,
    /// Of those, caught.
    pub caught: usize,
    /// Share of the catchable ones that were caught; `null` without any.
    pub rate: Option<f64>,
    /// Its 95 % interval (Wilson).
    pub ci95_low: f64,
    /// The other end.
    pub ci95_high: f64,
    /// Caught of all, in the catch space or not.
    pub caught_of_all: usize,
    /// Why balls of the catch space were missed.
    pub misses: BTreeMap<&'static str, usize>,
    /// Throws of two balls, each counted once, as in stepped time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pairs: Option<PairReport>,
    /// Balls that were thrown back, where the robot does that.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub throw_back: Option<ThrowBackReport>,
    /// Whether the calibration held, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<HeldReport>,
    /// Caught balls that were felt to be of a material.
    pub beliefs_after_catch: usize,
    /// Of them, of the right one.
    pub correct_materials: usize,
    /// Sweeps over them, on average.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sweeps_a_ball: Option<f64>,
    /// From the middle of an exposure to the first path that follows from it.
    pub exposure_to_path_ms: Option<Milliseconds>,
    /// How old the last picture was that a caught ball's path follows from, when it was caught.
    pub last_picture_age_ms: Option<Milliseconds>,
    /// How old the head's last pose was, as used by that path: the thesis's last measurement with an inertial unit.
    pub last_measurement_age_ms: Option<Milliseconds>,
    /// The controller's beat: 99.9 % of commands are put so soon after it.
    pub loop_p999_us: f64,
    /// Times that the monitor made the robot brake, or would have.
    pub monitor_brakes: u64,
    /// Of those, in vain.
    pub false_brakes: u64,
    /// Why the robot braked.
    pub brakes: BTreeMap<String, u64>,
    /// Paths that the controller refused.
    pub paths_refused: u64,
    /// Why, as far as it was heard.
    pub refusals: BTreeMap<String, u64>,
    /// Plans that found nothing.
    pub no_plans: u64,
    /// Processes that ended by themselves and began again.
    pub restarts: u64,
    /// How long it ran, s.
    pub seconds: f64,
    /// Work of every process.
    pub processes: BTreeMap<&'static str, RoleReport>,
    /// The world.
    pub world: WorldReport,
    /// The recording, where there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingReport>,
}

impl RunReport {
    pub(crate) fn of(
        heard: &Heard,
        parts: Vec<(&'static str, RoleReport)>,
        world: WorldReport,
        restarts: u64,
        seconds: f64,
        recording: Option<RecordingReport>,
    ) -> Self {
        let catchable: Vec<&CatchOutcome> = heard
            .outcomes
            .iter()
            .filter(|outcome| outcome.arms != 0)
            .collect();
        let caught = catchable
            .iter()
            .filter(|outcome| outcome.caught == 1)
            .count();
        let [ci95_low, ci95_high] = wilson_of_counts(caught, catchable.len());
        let mut misses = BTreeMap::new();
        for outcome in catchable.iter().filter(|outcome| outcome.caught == 0) {
            *misses.entry(cause(outcome.cause)).or_default() += 1;
        }
        let is_felt = |outcome: &&CatchOutcome| !outcome.felt.as_str().is_empty();
        let felt: Vec<&CatchOutcome> = heard.outcomes.iter().filter(is_felt).collect();
        let sweeps: u32 = felt.iter().map(|outcome| outcome.sweeps).sum();
        let processes: BTreeMap<&'static str, RoleReport> = parts.into_iter().collect();
        let of = |name: &str| processes.get(name).cloned().unwrap_or_default();
        let safety = of("safety");
        Self {
            balls: heard.outcomes.len(),
            catchable: catchable.len(),
            caught,
            rate: (!catchable.is_empty()).then(|| caught as f64 / catchable.len() as f64),
            ci95_low,
            ci95_high,
            caught_of_all: heard
                .outcomes
                .iter()
                .filter(|outcome| outcome.caught == 1)
                .count(),
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
            restarts,
            seconds,
            processes,
            world,
            recording,
        }
    }
}

/// What was recorded of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct RecordingReport {
    /// Packets.
    pub messages: u64,
    /// Packets that were put and never came.
    pub lost: u64,
    /// Why the rest is missing: a full disk, for example.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub broke_off: Option<String>,
}

/// Returns why a ball was missed, for people.
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

    #[test]
    fn rates_are_of_the_catch_space_and_ages_of_the_path_that_was_followed() {
        let mut heard = Heard::default();
        let path = |arm: u64, start_ns: u64| ArmPath {
            arm,
            start_ns,
            exposure_ns: start_ns - 70_000_000,
            head_ns: start_ns - 16_000_000,
            ..ArmPath::zeroed()
        };
        let outcome = |caught: u32, cause: u32, arms: u32, crossing_ns: u64| CatchOutcome {
            caught,
            cause,
            arms,
            arm: 1,
            crossing_ns,
            ..CatchOutcome::zeroed()
        };
        heard.times.path(1_055_000_000, &path(1, 1_060_000_000));
        heard.times.path(1_095_000_000, &path(1, 1_100_000_000));
        // A correction from the same picture.
        let corrected = ArmPath {
            exposure_ns: 1_030_000_000,
            ..path(1, 1_116_000_000)
        };
        heard.times.path(1_111_000_000, &corrected);
        heard.outcome(&CatchOutcome {
            material: Text::new("cork"),
            felt: Text::new("cork"),
            sweeps: 2,
            ..outcome(1, 0, 2, 1_150_000_000)
        });
        heard.outcome(&outcome(0, 3, 1, 9_150_000_000));
        heard.outcome(&outcome(0, 1, 0, 0));
        heard.outcome(&CatchOutcome {
            material: Text::new("cork"),
            felt: Text::new("felt"),
            sweeps: 3,
            ..outcome(1, 0, 0, 19_150_000_000)
        });
        heard.refused(2, "a path that came 12 us late");
        heard.refused(3, "a path that came 345 us late");
        heard.refused(1, "a path of no arm");
        let report = RunReport::of(&heard, Vec::new(), WorldReport::default(), 0, 1.0, None);
        assert_eq!(
            (
                report.balls,
                report.catchable,
                report.caught,
                report.caught_of_all
            ),
            (4, 2, 1, 2)
        );
        assert_eq!(report.misses, [("across", 1)].into());
        assert_eq!(
            (report.beliefs_after_catch, report.correct_materials),
            (2, 1)
        );
        assert_eq!(report.sweeps_a_ball, Some(2.5));
        assert_eq!(
            report.exposure_to_path_ms.map(|ms| (ms.count, ms.max)),
            Some((2, 65.0))
        );
        assert_eq!(
            report.last_picture_age_ms.map(|ms| (ms.count, ms.max)),
            Some((1, 120.0))
        );
        assert_eq!(report.last_measurement_age_ms.map(|ms| ms.p50), Some(50.0));
        assert_eq!(report.paths_refused, 4);
        let refusals = [("a path of no arm", 1), ("a path that came late", 3)];
        assert_eq!(
            report.refusals,
            refusals.map(|(why, n)| (why.to_owned(), n)).into()
        );
    }
}
