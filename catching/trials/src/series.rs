//! Series of throws and their statistics.

mod fingers;
mod modes;
mod obstacles;
mod page;
mod ramps;
mod row;

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use tactnet_catching::coordinate::assign;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::MAX_BALLS;
use tactnet_catching_world::{Miss, Verdict};

use crate::ablation::Ablation;
use crate::bound::Bound;
use crate::error::TrialError;
use crate::look_ahead::{LookAhead, PredictionErrors};
use crate::parallel::on_all_cores;
use crate::throw::Watching;
use crate::throw_config::{Mapping, ThrowConfig};
use crate::throw_outcome::{BallOutcome, ThrowOutcome};
use crate::trace::Trace;
use crate::watch::Braked;
use tactnet_catching::ChainDelays;
use tactnet_catching::plan::Objective;
use tactnet_plot::report::percent;
use tactnet_plot::wilson_of_counts;

pub use fingers::FingersReport;
pub use obstacles::{ObstaclesReport, WithoutMap};
pub use page::series_page;

/// A series of throws.
#[derive(Debug, Clone)]
pub struct Series {
    /// Settings of all throws.
    pub config: ThrowConfig,
    /// Number of throws.
    pub throws: u64,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Results of a series. A throw of two balls counts once: in the catch space if two arms can catch one each, and
/// caught if both are.
#[derive(Debug, Clone, Serialize)]
pub struct SeriesReport {
    /// Number of throws.
    pub throws: usize,
    /// Number of balls per throw.
    pub balls: usize,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Delays, in s.
    pub timing: ChainDelays,
    /// Objective of the planners.
    pub mode: Objective,
    /// Disabled parts.
    pub without: Vec<Ablation>,
    /// Number of throws without a return to the waiting pose; `None` if the robot returns after each.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_a_row: Option<u64>,
    /// True if head and balls were taken from the true state.
    pub perfect_perception: bool,
    /// True if circles were detected in rendered pictures.
    pub pixels: bool,
    /// Number of throws in the catch space.
    pub in_catch_space: usize,
    /// Number of caught throws in the catch space.
    pub caught: usize,
    /// `caught` divided by `in_catch_space`.
    pub rate: f64,
    /// Lower end of the 95 % Wilson interval of `rate`.
    pub ci95_low: f64,
    /// Upper end of the interval.
    pub ci95_high: f64,
    /// Share of caught throws of all throws.
    pub over_all_throws: f64,
    /// Results of the second judge.
    pub fingers: FingersReport,
    /// Number of missed balls in the catch space, by cause.
    pub misses: BTreeMap<String, usize>,
    /// Errors of the predictions.
    #[serde(flatten)]
    pub ahead: PredictionErrors,
    /// Cramer-Rao bound of the error perpendicular to the flight in mm, for the same flights with a head at rest and
    /// balls without spin.
    pub across_mm_bound: Option<f64>,
    /// Cramer-Rao bound of the error along the flight, in ms.
    pub along_ms_bound: Option<f64>,
    /// Number of plan requests without a solution, per throw.
    pub no_plans: f64,
    /// Number of throws in which the safety monitor demanded a stop while the robot moved.
    pub stopped: usize,
    /// Number of throws in which the monitor would have braked; `None` unless it only reports.
    pub braked: Option<usize>,
    /// Number of those throws in which no bodies would have come near each other during braking.
    pub braked_in_vain: Option<usize>,
    /// Number of those throws in which all distances would have exceeded the margin without braking.
    pub false_brakes: Option<usize>,
    /// Results among obstacles, if the robot looked around.
    #[serde(flatten)]
    pub obstacles: Option<ObstaclesReport>,
    /// Individual throws.
    #[serde(skip)]
    pub outcomes: Vec<ThrowOutcome>,
}

impl SeriesReport {
    /// Returns the number of the first completely caught throw, or of the first throw.
    fn drawn(&self) -> Option<u64> {
        let mut outcomes = self.outcomes.iter();
        let caught = outcomes.find(|outcome| outcome.all_caught());
        Some(caught.or(self.outcomes.first())?.number)
    }
}

impl fmt::Display for SeriesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = ["balls", "pairs of balls"][usize::from(self.balls != 1)];
        write!(
            f,
            "caught {} of {} {what} in the catch space: {}; {:.1} % of all {} throws",
            self.caught,
            self.in_catch_space,
            percent(self.rate, [self.ci95_low, self.ci95_high]),
            100.0 * self.over_all_throws,
            self.throws
        )?;
        for (cause, count) in &self.misses {
            write!(f, "\n  missed, {cause}: {count}")?;
        }
        write!(f, "{}", self.fingers)?;
        let ahead = &self.ahead;
        if let (Some(across), Some(along)) = (ahead.across_mm_rms_200ms, ahead.along_ms_rms_200ms) {
            write!(
                f,
                "\npredicted 200 ms before the catch: {across:.1} mm across the flight, {along:.2} ms along it (root mean squares)"
            )?;
        }
        if let (Some(median), Some(most), Some(far)) = (
            ahead.across_mm_p50_200ms,
            ahead.across_mm_p95_200ms,
            ahead.far_off_200ms,
        ) {
            write!(
                f,
                "; across it {median:.1} mm (median), 95 % below {most:.1} mm, {:.2} % more than 5 cm off",
                100.0 * far
            )?;
        }
        if let (Some(nees), Some([low, high])) = (ahead.nees_200ms, ahead.nees_band) {
            write!(
                f,
                "\nnormalised squared error of it: {nees:.2}, {low:.2} to {high:.2} if the filter's covariance is right"
            )?;
        }
        if let (Some(braked), Some(in_vain), Some(wrong)) =
            (self.braked, self.braked_in_vain, self.false_brakes)
        {
            write!(
                f,
                "\nthe monitor of self-collisions would have braked in {braked} of {} throws, {in_vain} times in vain; had the robot carried on, \
                 bodies would have stayed apart in {wrong} of them",
                self.throws
            )?;
        }
        match &self.obstacles {
            Some(obstacles) => write!(f, "{obstacles}"),
            None => Ok(()),
        }
    }
}

impl Series {
    /// Simulates the first completely caught throw again, or the first throw. Returns its number and the trace of its
    /// ticks.
    ///
    /// # Errors
    /// Same as [`Series::run`].
    pub fn drawn(&self, report: &SeriesReport) -> Result<Option<(u64, Trace)>, TrialError> {
        let number = report.drawn();
        let drawn = number.map(|number| Ok((number, self.again(number, 0.0)?)));
        drawn.transpose()
    }

    /// Simulates a throw again and returns the trace of its ticks, until `after` seconds after the last verdict.
    ///
    /// # Errors
    /// Same as [`Series::run`].
    pub fn again(&self, number: u64, after: f64) -> Result<Trace, TrialError> {
        let oracle = self.config.oracle();
        let watching = Watching {
            trace: Some(Trace::default()),
            after,
            ..Watching::default()
        };
        let simulated = self.config.simulate(self.seed, number, &oracle, watching)?;
        Ok(simulated.1.unwrap_or_default())
    }

    /// Runs all throws on all cores; `done` is called after each. The result does not depend on the number of cores.
    ///
    /// # Errors
    /// Invalid settings of the world.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<SeriesReport, TrialError> {
        let oracle = self.config.oracle();
        let outcomes = on_all_cores(0..self.throws, |number| {
            let outcome = self.config.run(self.seed, number, &oracle, None);
            done();
            outcome
        })?;
        Ok(self.report(outcomes))
    }

    /// Runs all throws among obstacles, and again with a robot that does not look around; `done` is called after
    /// each.
    ///
    /// # Errors
    /// Invalid settings of the world or of the depth camera.
    pub fn run_with_and_without_map(
        &self,
        done: impl Fn() + Sync,
    ) -> Result<SeriesReport, TrialError> {
        let with = |mapping| Self {
            config: ThrowConfig {
                mapping,
                ..self.config.clone()
            },
            ..*self
        };
        let mut report = with(Mapping::Depth).run(&done)?;
        let blind = with(Mapping::Blind).run(&done)?;
        if let Some(obstacles) = &mut report.obstacles {
            obstacles.without_map = Some(WithoutMap::of(&blind));
        }
        Ok(report)
    }

    fn report(&self, outcomes: Vec<ThrowOutcome>) -> SeriesReport {
        let counts = CatchCounts::of(&outcomes);
        let balls = || outcomes.iter().flat_map(|outcome| &outcome.balls);
        let ahead: Vec<LookAhead> = balls().filter_map(|ball| ball.ahead).collect();
        let bounds: Vec<&Bound> = balls().filter_map(|ball| ball.bound.as_ref()).collect();
        let least = |of: fn(&Bound) -> f64| {
            (!bounds.is_empty()).then(|| {
                let squares = bounds.iter().map(|bound| of(bound).powi(2)).sum::<f64>();
                (squares / bounds.len() as f64).sqrt()
            })
        };
        let brakes = |of: &dyn Fn(&Braked) -> bool| {
            let braked = outcomes.iter().filter_map(|one| one.braked.as_ref());
            let count = || braked.filter(|braked| of(braked)).count();
            self.config.watch.then(count)
        };
        let throws = outcomes.len().max(1) as f64;
        let [ci95_low, ci95_high] = wilson_of_counts(counts.caught, counts.in_space);
        SeriesReport {
            throws: outcomes.len(),
            balls: self.config.balls,
            seed: self.seed,
            timing: self.config.timing,
            mode: self.config.objective,
            without: self.config.without.clone(),
            in_a_row: None,
            perfect_perception: self.config.perfect_perception,
            pixels: self.config.pixels,
            in_catch_space: counts.in_space,
            caught: counts.caught,
            rate: counts.caught as f64 / counts.in_space.max(1) as f64,
            ci95_low,
            ci95_high,
            over_all_throws: counts.caught_of_all as f64 / throws,
            fingers: FingersReport::of(&outcomes),
            misses: counts.misses,
            ahead: PredictionErrors::of(&ahead, !self.config.perfect_perception),
            across_mm_bound: least(|bound| bound.across_mm),
            along_ms_bound: least(|bound| bound.along_ms),
            no_plans: outcomes.iter().map(|of| of.no_plans as f64).sum::<f64>() / throws,
            stopped: outcomes.iter().filter(|of| of.stops > 0).count(),
            braked: brakes(&|_| true),
            braked_in_vain: brakes(&|braked| braked.in_vain),
            false_brakes: brakes(&Braked::is_false),
            obstacles: ObstaclesReport::of(&outcomes),
            outcomes,
        }
    }
}

/// Numbers of throws whose balls were all caught, and causes of misses.
#[derive(Default)]
struct CatchCounts {
    in_space: usize,
    /// Caught throws in the catch space.
    caught: usize,
    caught_of_all: usize,
    /// Missed balls in the catch space.
    misses: BTreeMap<String, usize>,
}

impl CatchCounts {
    fn of(outcomes: &[ThrowOutcome]) -> Self {
        let mut counts = Self::default();
        for outcome in outcomes {
            let all = outcome.all_caught();
            counts.caught_of_all += usize::from(all);
            if !both_possible(&outcome.balls) {
                continue;
            }
            counts.in_space += 1;
            counts.caught += usize::from(all);
            let among = outcome.obstacles.as_ref();
            for ball in outcome.balls.iter().filter(|ball| !ball.caught()) {
                let cause = match cause(ball.verdict.as_ref(), ball.tracked, ball.planned) {
                    "no plan" if among.is_some_and(|among| among.obstructed > 0) => {
                        "obstacles in every way"
                    }
                    cause => cause,
                };
                *counts.misses.entry(cause.to_string()).or_insert(0) += 1;
            }
        }
        counts
    }
}

/// Returns true if every ball can be caught by a separate arm.
fn both_possible(balls: &[BallOutcome]) -> bool {
    let mut costs = [[None; ARMS]; MAX_BALLS];
    for (place, ball) in balls.iter().enumerate().take(MAX_BALLS) {
        costs[place] = ball.arms.map(|possible| possible.then_some(0.0));
    }
    assign(&costs).iter().flatten().count() == balls.len()
}

pub(crate) fn cause(verdict: Option<&Verdict>, tracked: bool, planned: bool) -> &'static str {
    match verdict.and_then(|verdict| verdict.miss) {
        _ if !tracked => "not tracked",
        _ if !planned => "no plan",
        Some(Miss::Across) => "across",
        Some(Miss::Angle) => "angle",
        Some(Miss::Early) => "closed too early",
        Some(Miss::Late) => "closed too late",
        Some(Miss::NoCommand) => "not closed",
        Some(Miss::NeverCameNear) => "hand elsewhere",
        None => "not judged",
    }
}
