//! Second judge of a series, and close-ups of the fingers (thesis, figure 3.3).

use std::collections::BTreeMap;
use std::fmt::{self, Write};

use serde::Serialize;
use tactnet_catching::flight::BALL_RADIUS;
use tactnet_catching_world::{Cage, FingersConfig, Grasp};
use tactnet_plot::{stand_alone, wilson_of_counts};

use super::{Series, SeriesReport, both_possible};
use crate::error::TrialError;
use crate::throw_outcome::{BallOutcome, ThrowOutcome};
use crate::trace::TraceTick;
use tactnet_plot::report::percent;

/// Time between two close-ups in s, as in the thesis, and their number; the second one is at the catch.
const EVERY: f64 = 0.0265;
const CLOSE_UPS: usize = 6;
/// Width and height of a close-up in pixels, and its scale in pixels per metre.
const WIDTH: f64 = 300.0;
const HEIGHT: f64 = 220.0;
const SCALE: f64 = 850.0;
/// Place of the catch frame in a close-up, in pixels.
const ORIGIN: (f64, f64) = (120.0, 118.0);

/// Numbers of throws whose balls the simulated fingers caged, compared with those that the first judge counts.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FingersReport {
    /// Number of caged throws in the catch space.
    pub caged: usize,
    /// `caged` divided by the number of throws in the catch space.
    pub rate: f64,
    /// 95 % Wilson interval of `rate`.
    pub ci95: [f64; 2],
    /// Share of caged throws of all throws.
    pub over_all_throws: f64,
    /// 95 % Wilson interval of that share.
    pub over_all_ci95: [f64; 2],
    /// 95 % Wilson interval of the share of throws that the first judge calls caught.
    pub caught_over_all_ci95: [f64; 2],
    /// Number of throws that only the first judge calls caught.
    pub caught_not_caged: usize,
    /// Number of throws that only the second judge calls caught.
    pub caged_not_caught: usize,
    /// Number of balls by outcome; each miss with the verdict of the first judge.
    pub outcomes: BTreeMap<String, usize>,
}

impl FingersReport {
    pub(super) fn of(throws: &[ThrowOutcome]) -> Self {
        let caught = ThrowOutcome::all_caught;
        let is_caged = |ball: &BallOutcome| ball.cage == Some(Cage::Caged);
        let caged = |throw: &ThrowOutcome| throw.balls.iter().all(is_caged);
        let count =
            |is: &dyn Fn(&ThrowOutcome) -> bool| throws.iter().filter(|one| is(one)).count();
        let in_space = count(&|throw| both_possible(&throw.balls));
        let inside = count(&|throw| caged(throw) && both_possible(&throw.balls));
        let all = count(&caged);
        let mut outcomes = BTreeMap::new();
        for ball in throws.iter().flat_map(|throw| &throw.balls) {
            *outcomes.entry(words(ball)).or_insert(0) += 1;
        }
        Self {
            caged: inside,
            rate: inside as f64 / in_space.max(1) as f64,
            ci95: wilson_of_counts(inside, in_space),
            over_all_throws: all as f64 / throws.len().max(1) as f64,
            over_all_ci95: wilson_of_counts(all, throws.len()),
            caught_over_all_ci95: wilson_of_counts(count(&caught), throws.len()),
            caught_not_caged: count(&|throw| caught(throw) && !caged(throw)),
            caged_not_caught: count(&|throw| caged(throw) && !caught(throw)),
            outcomes,
        }
    }
}

/// Returns both verdicts on a ball in words.
fn words(ball: &BallOutcome) -> String {
    let fingers = match ball.cage {
        Some(Cage::Caged) => "caged",
        Some(Cage::BouncedOut) => "bounced out",
        Some(Cage::Deflected) => "deflected",
        Some(Cage::Untouched) => "untouched",
        None => "not judged",
    };
    let first = match ball.caught() {
        true => "caught",
        false => super::cause(ball.verdict.as_ref(), ball.tracked, ball.planned),
    };
    format!("{fingers} ({first})")
}

impl fmt::Display for FingersReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "\nwith simulated fingers caged {}: {}; {:.1} % of all throws; {} caught but not caged, {} caged but not caught",
            self.caged,
            percent(self.rate, self.ci95),
            100.0 * self.over_all_throws,
            self.caught_not_caged,
            self.caged_not_caught
        )
    }
}

impl Series {
    /// Simulates the throw of [`Series::drawn`] again and returns a file with close-ups of the hand that catches, every
    /// 26.5 ms. `None` without a plan.
    ///
    /// # Errors
    /// Same as [`Series::run`].
    pub fn fingers_picture(&self, report: &SeriesReport) -> Result<Option<String>, TrialError> {
        let Some(number) = report.drawn() else {
            return Ok(None);
        };
        let trace = self.again(number, CLOSE_UPS as f64 * EVERY)?;
        let Some(plan) = trace.plans.last() else {
            return Ok(None);
        };
        let mut svg = String::new();
        for place in 0..CLOSE_UPS {
            let t = plan.catch + (place as f64 - 1.0) * EVERY;
            let near = |tick: &&TraceTick| tick.t + 1e-3 > t;
            let Some(tick) = trace.ticks.iter().find(near) else {
                break;
            };
            let (column, row) = (place % 3, place / 3);
            let _ = write!(
                svg,
                "<g transform=\"translate({:.0} {:.0})\">{}<text x=\"12\" y=\"20\">{:.1} ms</text></g>",
                column as f64 * WIDTH,
                row as f64 * HEIGHT,
                close_up(&tick.grasps[plan.arm], &self.config.world.fingers),
                1e3 * (t - plan.catch)
            );
        }
        let title = "Fingers and ball during a catch, every 26.5 ms";
        let rows = CLOSE_UPS.div_ceil(3) as f64;
        Ok(Some(stand_alone(3.0 * WIDTH, rows * HEIGHT, title, &svg)))
    }
}

/// Draws palm, fingers and balls from the side, with the hand's axis to the right.
fn close_up(grasp: &Grasp, config: &FingersConfig) -> String {
    let at = |along: f64, aside: f64| (ORIGIN.0 + SCALE * along, ORIGIN.1 - SCALE * aside);
    let line = |points: &[(f64, f64)], radius: f64, colour: &str| {
        let points = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}"));
        format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{:.1}\" stroke-linecap=\"round\" \
             stroke-linejoin=\"round\"/>",
            points.collect::<Vec<_>>().join(" "),
            2.0 * radius * SCALE
        )
    };
    let finger = |index: usize, colour: &str| {
        let chain = grasp.fingers[index].map(|node| at(node.z, node.x));
        line(&chain, config.radius, colour)
    };
    let palm = grasp.fingers[0][0].z;
    let palm = [at(palm, -config.palm), at(palm, config.palm)];
    // The finger behind the ball first; the one before it is left out.
    let mut svg = line(&palm, 0.004, "#43596f") + &finger(3, "#c3ccd4");
    let balls = grasp.balls.iter().flatten();
    for ball in balls.filter(|ball| ball.norm() < 0.25) {
        let (x, y) = at(ball.z, ball.x);
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"#c8551b\" opacity=\"0.8\"/>",
            BALL_RADIUS * SCALE
        );
    }
    svg + &finger(0, "#43596f") + &finger(2, "#43596f")
}
