//! Many throws, with what a reader wants to know of them.

use std::collections::BTreeMap;
use std::fmt;

use rayon::prelude::*;
use serde::Serialize;
use tactnet_catching::coordinate::assign;
use tactnet_catching_packets::ARMS;
use tactnet_catching_packets::packets::MAX_BALLS;
use tactnet_catching_world::{Miss, Verdict};

use crate::ablation::Ablation;
use crate::bound::Bound;
use crate::error::TrialError;
use crate::look::Mapping;
use crate::look_ahead::{Errors, LookAhead};
use crate::obstacles::{ObstaclesReport, WithoutMap};
use crate::throw::{BallOutcome, ThrowConfig, ThrowOutcome};
use crate::trace::Trace;
use tactnet_catching::CatchSpace;
use tactnet_catching::ChainDelays;
use tactnet_plot::wilson_of_counts;

/// Ahead of the catch, s, that predictions are judged at.
pub const AHEAD: f64 = 0.2;

/// A series of throws.
#[derive(Debug, Clone)]
pub struct Series {
    /// What all throws share.
    pub config: ThrowConfig,
    /// How many.
    pub throws: u64,
    /// Of throws, noise, everything drawn.
    pub seed: u64,
}

/// What a series gave. A throw of two balls counts once: in the catch space if two arms can catch one each, caught if both are.
#[derive(Debug, Clone, Serialize)]
pub struct SeriesReport {
    /// Throws.
    pub throws: usize,
    /// Balls a throw.
    pub balls: usize,
    /// Seed.
    pub seed: u64,
    /// Delays, s.
    pub timing: ChainDelays,
    /// What was left out.
    pub without: Vec<Ablation>,
    /// True if head and balls were known from the truth.
    pub perfect_perception: bool,
    /// True if circles were found in pictures.
    pub pixels: bool,
    /// Throws that the oracle can catch.
    pub in_catch_space: usize,
    /// Of those, caught.
    pub caught: usize,
    /// `caught` of `in_catch_space`.
    pub rate: f64,
    /// Wilson's 95 % interval of `rate`.
    pub ci95_low: f64,
    /// See `ci95_low`.
    pub ci95_high: f64,
    /// All that were caught, of all throws.
    pub over_all_throws: f64,
    /// Balls in the catch space that were missed, by cause.
    pub misses: BTreeMap<String, usize>,
    /// Error of the prediction 200 ms before the catch, across the flight, mm, root mean square over balls.
    pub across_mm_rms_200ms: Option<f64>,
    /// The same along the flight, ms.
    pub along_ms_rms_200ms: Option<f64>,
    /// The least that an unbiased prediction of the same flights could have across, mm: the bound of Cramer and Rao for a head that stands
    /// still and a ball without spin.
    pub across_mm_bound: Option<f64>,
    /// The same along the flight, ms.
    pub along_ms_bound: Option<f64>,
    /// Mean of the normalised squared error of the position predicted then; 3 if the filter's covariance is right.
    pub nees_200ms: Option<f64>,
    /// 95 % band of that mean, if it were.
    pub nees_band: Option<[f64; 2]>,
    /// True if it lies in the band.
    pub nees_in_band: Option<bool>,
    /// Balls that those four figures are of.
    pub predictions: usize,
    /// Plans that found nothing, a throw.
    pub no_plans: f64,
    /// Throws in which the monitor of self-collisions would have braked; `None` if it did not watch.
    pub braked: Option<usize>,
    /// Of those, throws in which no bodies would have come near each other while it braked.
    pub braked_in_vain: Option<usize>,
    /// Of those that it would have braked, throws in which the robot, had it carried on, would have kept all bodies farther apart than the
    /// monitor's margin.
    pub false_brakes: Option<usize>,
    /// Of obstacles, if the robot looked about.
    #[serde(flatten)]
    pub obstacles: Option<ObstaclesReport>,
    /// What the curve of errors is made of.
    #[serde(skip)]
    pub outcomes: Vec<ThrowOutcome>,
}

impl fmt::Display for SeriesReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let what = if self.balls == 1 {
            "balls"
        } else {
            "pairs of balls"
        };
        write!(
            f,
            "caught {} of {} {what} in the catch space: {:.1} % [{:.1}, {:.1}]; {:.1} % of all {} throws",
            self.caught,
            self.in_catch_space,
            100.0 * self.rate,
            100.0 * self.ci95_low,
            100.0 * self.ci95_high,
            100.0 * self.over_all_throws,
            self.throws
        )?;
        for (cause, count) in &self.misses {
            write!(f, "\n  missed, {cause}: {count}")?;
        }
        if let (Some(across), Some(along)) = (self.across_mm_rms_200ms, self.along_ms_rms_200ms) {
            write!(
                f,
                "\npredicted 200 ms before the catch: {across:.1} mm across the flight, {along:.2} ms along it (root mean squares)"
            )?;
        }
        if let (Some(nees), Some([low, high])) = (self.nees_200ms, self.nees_band) {
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
    /// Runs the first throw that was caught whole, or the first one, again: its number, and what happened tick by tick.
    ///
    /// # Errors
    /// As [`Series::run`].
    pub fn drawn(&self, report: &SeriesReport) -> Result<Option<(u64, Trace)>, TrialError> {
        let mut outcomes = report.outcomes.iter();
        let caught = outcomes.find(|outcome| outcome.balls.iter().all(|ball| ball.caught()));
        let Some(outcome) = caught.or(report.outcomes.first()) else {
            return Ok(None);
        };
        Ok(Some((outcome.number, self.again(outcome.number)?)))
    }

    /// Runs a throw again: what happened tick by tick.
    ///
    /// # Errors
    /// As [`Series::run`].
    pub fn again(&self, number: u64) -> Result<Trace, TrialError> {
        let oracle = CatchSpace::new(&self.config.robot, self.config.moves_lower_body());
        let ready = self.config.ready();
        let (_, trace) = self.config.trace(self.seed, number, &ready, &oracle)?;
        Ok(trace)
    }

    /// Runs all throws on all cores; `done` is told after each. The result does not depend on how many there are.
    ///
    /// # Errors
    /// Where the world's settings make no sense.
    pub fn run(&self, done: impl Fn() + Sync) -> Result<SeriesReport, TrialError> {
        let ready = self.config.ready();
        let oracle = CatchSpace::new(&self.config.robot, self.config.moves_lower_body());
        let outcomes: Result<Vec<ThrowOutcome>, TrialError> = (0..self.throws)
            .into_par_iter()
            .map(|number| {
                let outcome = self.config.run(self.seed, number, &ready, &oracle);
                done();
                outcome
            })
            .collect();
        Ok(self.report(outcomes?))
    }

    /// Runs all throws among obstacles, and then again with a robot that does not look, for comparison; `done` is told after each.
    ///
    /// # Errors
    /// Where the world's settings make no sense, or a depth picture does.
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
        let mut misses = BTreeMap::new();
        let (mut in_space, mut caught, mut over_all) = (0, 0, 0);
        for outcome in &outcomes {
            let all = outcome.balls.iter().all(BallOutcome::caught);
            over_all += usize::from(all);
            if !both_possible(&outcome.balls) {
                continue;
            }
            in_space += 1;
            caught += usize::from(all);
            let among = outcome.obstacles.as_ref();
            for ball in outcome.balls.iter().filter(|ball| !ball.caught()) {
                let cause = match cause(ball.verdict.as_ref(), ball.tracked, ball.planned) {
                    "no plan" if among.is_some_and(|among| among.obstructed > 0) => {
                        "obstacles in every way"
                    }
                    cause => cause,
                };
                *misses.entry(cause.to_string()).or_insert(0) += 1;
            }
        }
        let ahead: Vec<LookAhead> = outcomes
            .iter()
            .flat_map(|outcome| &outcome.balls)
            .filter_map(|ball| ball.ahead)
            .collect();
        let errors = Errors::of(&ahead);
        // The truth comes without a covariance.
        let known = errors.filter(|_| !self.config.perfect_perception);
        let bounds: Vec<&Bound> = outcomes
            .iter()
            .flat_map(|outcome| &outcome.balls)
            .filter_map(|ball| ball.bound.as_ref())
            .collect();
        let least = |of: fn(&Bound) -> f64| {
            (!bounds.is_empty()).then(|| {
                let squares = bounds.iter().map(|bound| of(bound).powi(2)).sum::<f64>();
                (squares / bounds.len() as f64).sqrt()
            })
        };
        let brakes = || {
            outcomes
                .iter()
                .filter_map(|outcome| outcome.braked.as_ref())
        };
        let [ci95_low, ci95_high] = wilson_of_counts(caught, in_space);
        SeriesReport {
            throws: outcomes.len(),
            balls: self.config.balls,
            seed: self.seed,
            timing: self.config.timing,
            without: self.config.without.clone(),
            perfect_perception: self.config.perfect_perception,
            pixels: self.config.pixels,
            in_catch_space: in_space,
            caught,
            rate: if in_space == 0 {
                0.0
            } else {
                caught as f64 / in_space as f64
            },
            ci95_low,
            ci95_high,
            over_all_throws: over_all as f64 / outcomes.len().max(1) as f64,
            misses,
            across_mm_rms_200ms: errors.map(|errors| errors.across_mm_rms),
            along_ms_rms_200ms: errors.map(|errors| errors.along_ms_rms),
            across_mm_bound: least(|bound| bound.across_mm),
            along_ms_bound: least(|bound| bound.along_ms),
            nees_200ms: known.map(|errors| errors.nees),
            nees_band: known.map(|errors| errors.nees_band),
            nees_in_band: known.map(|errors| errors.nees_in_band()),
            predictions: ahead.len(),
            no_plans: outcomes
                .iter()
                .map(|outcome| outcome.no_plans as f64)
                .sum::<f64>()
                / outcomes.len().max(1) as f64,
            braked: self.config.watch.then(|| brakes().count()),
            braked_in_vain: self
                .config
                .watch
                .then(|| brakes().filter(|braked| braked.in_vain).count()),
            false_brakes: self
                .config
                .watch
                .then(|| brakes().filter(|braked| braked.is_false()).count()),
            obstacles: ObstaclesReport::of(&outcomes),
            outcomes,
        }
    }
}

/// True if every ball can be caught by an arm of its own.
fn both_possible(balls: &[BallOutcome]) -> bool {
    let mut costs = [[None; ARMS]; MAX_BALLS];
    for (place, ball) in balls.iter().enumerate().take(MAX_BALLS) {
        costs[place] = ball.arms.map(|possible| possible.then_some(0.0));
    }
    assign(&costs).iter().flatten().count() == balls.len()
}

/// Returns the cause of a miss in words.
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
