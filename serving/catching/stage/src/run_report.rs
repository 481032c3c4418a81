//! What came of a run.

use std::collections::BTreeMap;

use serde::Serialize;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::{ArmPath, CatchOutcome};
use tactnet_catching_roles::RoleReport;
use tactnet_catching_trials::wilson;

use crate::world_role::WorldReport;

/// A path that begins so long before its catch is the one that it was caught by, ns.
const LATEST_NS: u64 = 2_000_000_000;

/// What was heard on the channels.
#[derive(Debug, Default)]
pub(crate) struct Heard {
    pub outcomes: Vec<CatchOutcome>,
    pub no_plans: u64,
    /// From exposure to the path's put, ms.
    to_path_ms: Vec<f64>,
    /// The last paths of both arms.
    paths: [Option<ArmPath>; ARMS],
    /// From the last picture, and from the last pose of the head, to the crossing, ms.
    picture_age_ms: Vec<f64>,
    head_age_ms: Vec<f64>,
    brakes: BTreeMap<String, u64>,
    refused: u64,
    refused_now: u64,
}

impl Heard {
    pub fn path(&mut self, put_ns: u64, path: &ArmPath) {
        if let Some(place) = self.paths.get_mut(path.arm as usize) {
            // A last correction follows from a newer pose of the head, not from a picture.
            if place.is_none_or(|before| before.exposure_ns != path.exposure_ns) {
                self.to_path_ms
                    .push(milliseconds(put_ns.saturating_sub(path.exposure_ns)));
            }
            *place = Some(*path);
        }
    }

    pub fn braked(&mut self, why: &str) {
        *self.brakes.entry(why.into()).or_default() += 1;
    }

    /// Takes how many paths a controller has refused since it began.
    pub fn refused(&mut self, count: u64) {
        if count < self.refused_now {
            self.refused_now = 0;
        }
        self.refused += count - self.refused_now;
        self.refused_now = count;
    }

    pub fn outcome(&mut self, outcome: &CatchOutcome) {
        self.outcomes.push(*outcome);
        let path = self.paths.get(outcome.arm as usize).copied().flatten();
        let Some(path) = path.filter(|path| {
            outcome.crossing_ns > path.start_ns && outcome.crossing_ns - path.start_ns < LATEST_NS
        }) else {
            return;
        };
        if outcome.caught == 1 {
            self.picture_age_ms
                .push(milliseconds(outcome.crossing_ns - path.exposure_ns));
            self.head_age_ms.push(milliseconds(
                outcome.crossing_ns.saturating_sub(path.head_ns),
            ));
        }
    }
}

fn milliseconds(ns: u64) -> f64 {
    ns as f64 * 1e-6
}

/// Times over a run, ms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Milliseconds {
    /// How many.
    pub count: usize,
    /// Median.
    pub p50: f64,
    /// 99th percentile.
    pub p99: f64,
    /// The longest.
    pub max: f64,
}

impl Milliseconds {
    fn of(values: &[f64]) -> Option<Self> {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |share: f64| {
            sorted[((share * sorted.len() as f64).ceil() as usize).clamp(1, sorted.len()) - 1]
        };
        (!sorted.is_empty()).then(|| Self {
            count: sorted.len(),
            p50: at(0.5),
            p99: at(0.99),
            max: at(1.0),
        })
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
}

impl RunReport {
    pub(crate) fn of(
        heard: &Heard,
        parts: Vec<(&'static str, RoleReport)>,
        world: WorldReport,
        restarts: u64,
        seconds: f64,
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
        let [ci95_low, ci95_high] = wilson(caught, catchable.len());
        let mut misses = BTreeMap::new();
        for outcome in catchable.iter().filter(|outcome| outcome.caught == 0) {
            *misses.entry(cause(outcome.cause)).or_default() += 1;
        }
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
            exposure_to_path_ms: Milliseconds::of(&heard.to_path_ms),
            last_picture_age_ms: Milliseconds::of(&heard.picture_age_ms),
            last_measurement_age_ms: Milliseconds::of(&heard.head_age_ms),
            loop_p999_us: of("controller").p999_us,
            monitor_brakes: safety.brakes,
            false_brakes: safety.brakes_in_vain,
            brakes: heard.brakes.clone(),
            paths_refused: heard.refused,
            no_plans: heard.no_plans,
            restarts,
            seconds,
            processes,
            world,
        }
    }
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
        heard.path(1_055_000_000, &path(1, 1_060_000_000));
        heard.path(1_095_000_000, &path(1, 1_100_000_000));
        // A correction from the same picture.
        let corrected = ArmPath {
            exposure_ns: 1_030_000_000,
            ..path(1, 1_116_000_000)
        };
        heard.path(1_111_000_000, &corrected);
        heard.outcome(&outcome(1, 0, 2, 1_150_000_000));
        heard.outcome(&outcome(0, 3, 1, 9_150_000_000));
        heard.outcome(&outcome(0, 1, 0, 0));
        heard.outcome(&outcome(1, 0, 0, 19_150_000_000));
        heard.refused(2);
        heard.refused(3);
        heard.refused(1);
        let report = RunReport::of(&heard, Vec::new(), WorldReport::default(), 0, 1.0);
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
            report.exposure_to_path_ms.map(|ms| (ms.count, ms.max)),
            Some((2, 65.0))
        );
        assert_eq!(
            report.last_picture_age_ms.map(|ms| (ms.count, ms.max)),
            Some((1, 120.0))
        );
        assert_eq!(report.last_measurement_age_ms.map(|ms| ms.p50), Some(50.0));
        assert_eq!(report.paths_refused, 4);
    }
}
