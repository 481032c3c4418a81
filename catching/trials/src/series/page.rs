//! HTML page of a series: rates, errors before the catch, one drawn throw.

use std::ops::Range;

use maud::{Markup, html};
use nalgebra::Vector3;
use tactnet_catching::Robot;
use tactnet_catching::flight::{DRAG, Flight};
use tactnet_catching_packets::joint;
use tactnet_plot::{Axes, Axis, Series as Curve};

use super::obstacles::scene_figures;
use super::{Series, SeriesReport};
use crate::bound::{Bound, bounds};
use crate::error::TrialError;
use crate::look_ahead::LookAhead;
use crate::picture::picture;
use crate::trace::{Trace, TracePlan, TraceTick};
use tactnet_plot::report::{axes, captioned, chart, legend, report_page};

/// Minimum cost of plans that are not exact catches.
const NEAR_MISS: f64 = 10.0;

/// Returns a self-contained page.
///
/// # Errors
/// Same as the series, because the drawn throw is simulated again.
pub fn series_page(series: &Series, report: &SeriesReport) -> Result<String, TrialError> {
    let (title, figures) = match &report.obstacles {
        Some(obstacles) => (
            "Catching among obstacles",
            scene_figures(series, report, obstacles)?,
        ),
        None => ("Balls caught", flight_figures(series, report)?),
    };
    Ok(report_page(title, &report.to_string(), figures, report))
}

fn flight_figures(series: &Series, report: &SeriesReport) -> Result<Markup, TrialError> {
    let drawn = series.drawn(report)?;
    Ok(html! {
        @if let Some(errors) = errors(series, report) {
            h2 { "How well flights are predicted" }
            (errors)
        }
        @if let Some((number, trace)) = drawn {
            h2 { "Throw " (number) }
            (throw(&trace, &series.config.robot))
        }
    })
}

/// Draws the root mean square errors over the time to the catch, those according to the filter, and the bound.
fn errors(series: &Series, report: &SeriesReport) -> Option<Markup> {
    let balls = report.outcomes.iter().flat_map(|outcome| &outcome.balls);
    let all: Vec<&LookAhead> = balls.flat_map(|ball| &ball.predictions).collect();
    let frame = 1.0 / series.config.robot.description().cameras.rate;
    let rms = |left: f64, of: &dyn Fn(&LookAhead) -> f64| {
        let near = all.iter().filter(|a| (a.left - left).abs() <= frame / 2.0);
        let squares: Vec<f64> = near.map(|a| of(a).powi(2)).collect();
        (squares.len() >= 5).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    };
    let lefts: Vec<f64> = (0..16).map(|i| frame * (f64::from(i) + 1.0)).collect();
    let curve = |of: &dyn Fn(&LookAhead) -> f64| -> Vec<(f64, f64)> {
        lefts
            .iter()
            .filter_map(|left| Some((1e3 * left, rms(*left, of)?.max(1e-3))))
            .collect()
    };
    let errors_across = curve(&|a| a.across_mm);
    if errors_across.len() < 2 {
        return None;
    }
    // A throw from 5 m with 7 m/s.
    let (p, v) = (Vector3::new(5.6, 0.0, 1.5), Vector3::new(-6.6, 0.1, 2.6));
    let (release, robot) = (Flight::without_spin(p, v, DRAG), &series.config.robot);
    let zeros = [0.0; tactnet_catching_packets::JOINTS];
    let head = robot.chest(&zeros) * robot.head(&zeros);
    let bound = bounds(&release, 0.02, 0.8, &head, &robot.description().cameras);
    let of_bound = |of: &dyn Fn(&Bound) -> f64| -> Vec<(f64, f64)> {
        let shown = bound.iter().filter(|b| b.left <= 0.65);
        shown.map(|b| (1e3 * b.left, of(b))).collect()
    };
    let across = [
        errors_across,
        curve(&|a| a.sigma_across_mm),
        of_bound(&|b| b.across_mm),
    ];
    let along = [
        curve(&|a| a.along_ms),
        curve(&|a| a.sigma_along_ms),
        of_bound(&|b| b.along_ms),
    ];
    let across = over_time("Error across the flight", "across [mm]", &across)?;
    let along = over_time("Error along the flight", "along [ms]", &along)?;
    Some(html! {
        (captioned(
            &across,
            "Root mean square of the prediction's error across the flight, over the time from its last picture to the catch.",
        ))
        (captioned(&along, "The same along the flight."))
        (legend(&["error", "what the filter says", "bound of Cramer and Rao, still head, a typical throw"]))
    })
}

fn over_time(title: &str, label: &str, curves: &[Vec<(f64, f64)>]) -> Option<String> {
    let axes = axes(
        240.0,
        Axis::linear("time to the catch [ms]", 0.0..=650.0, 100.0),
        Axis::decades(label, curves.iter().flatten().map(|(_, value)| *value))?,
    );
    let lines: String = curves
        .iter()
        .enumerate()
        .map(|(i, points)| axes.line(Curve::nth(i), points, 1))
        .collect();
    Some(chart(title, &axes, &lines))
}

/// Draws balls and hands from above, with a marker every 40 ms.
fn from_above(trace: &Trace) -> String {
    let axes = axes(
        200.0,
        Axis::linear("before the robot [m]", -0.5..=6.5, 1.0),
        Axis::linear("to the left [m]", -1.5..=1.5, 0.5),
    );
    let way = |of: &dyn Fn(&TraceTick) -> Option<Vector3<f64>>| -> Vec<(f64, f64)> {
        let places = trace.ticks.iter().filter_map(of);
        places.step_by(10).map(|place| (place.x, place.y)).collect()
    };
    let lines = [
        way(&|tick| tick.balls[0]),
        way(&|tick| Some(tick.hands[0])),
        way(&|tick| Some(tick.hands[1])),
        way(&|tick| tick.balls[1]),
    ];
    let lines: String = lines
        .iter()
        .enumerate()
        .filter(|(_, line)| !line.is_empty())
        .map(|(i, line)| axes.line(Curve::nth(i), line, 4))
        .collect();
    chart("Ball and hands", &axes, &lines)
}

fn throw(trace: &Trace, robot: &Robot) -> Markup {
    if trace.ticks.is_empty() {
        return html! {};
    }
    let arm = trace.plans.last().map_or(0, |plan| plan.arm);
    let names: Vec<String> = (1..=robot.arm(arm).joints().len())
        .map(|i| format!("joint {i}"))
        .collect();
    html! {
        (captioned(
            &picture(trace).unwrap_or_default(),
            "Robot and balls from the side, faint when thrown and on the way, a ball every 40 ms,",
        ))
        (captioned(&from_above(trace), "and ball and hands from above."))
        (legend(&["ball", "left hand", "right hand"]))
        (captioned(
            &joint_rates(trace, joint::ARM[arm].clone()),
            "Joint rates of the arm that catches: commanded, and faintly as measured. Kinks are corrections.",
        ))
        (legend(&names))
        (captioned(
            &joint_rates(trace, joint::PLATFORM..joint::NECK.end),
            "The same for platform (in m/s), torso and neck.",
        ))
        (legend(&["platform", "torso, vertical", "lower pitch", "upper pitch", "pan", "tilt"]))
        @if let Some(costs) = plan_costs(trace, arm) {
            (captioned(
                &costs,
                "What each plan that was carried out cost: with the soft objective, the share of its acceleration that the arm needs. \
                 Plans that could only come near are left out.",
            ))
        }
    }
}

fn time_axis(trace: &Trace) -> Axis {
    let last = trace.ticks.last().map_or(0.0, |tick| tick.t);
    let end = (last * 10.0).ceil() / 10.0;
    Axis::linear("time since the throw [s]", 0.0..=end, 0.2)
}

fn joint_rates(trace: &Trace, joints: Range<usize>) -> String {
    let (axes, lines) = rates(trace, joints);
    chart("Joint rates", &axes, &lines)
}

/// Returns axes, and the commanded and, faintly, the measured rates of joints.
pub(super) fn rates(trace: &Trace, joints: Range<usize>) -> (Axes, String) {
    let axes = axes(
        240.0,
        time_axis(trace),
        Axis::linear("joint rate [rad/s]", -3.0..=3.0, 1.0),
    );
    let ticks: Vec<_> = trace.ticks.iter().map(|tick| (tick.t, tick)).collect();
    let commanded = rate_lines(&axes, &ticks, joints.clone(), 0, |tick| &tick.commanded);
    let measured = rate_lines(&axes, &ticks, joints, 0, |tick| &tick.measured);
    let lines = format!("{commanded}<g class=\"faint\">{measured}</g>");
    (axes, lines)
}

/// Returns lines of the rates of joints.
///
/// - `ticks`: ticks with their times on the axis, of which every fourth is drawn
/// - `first`: index of the first line's style
pub(super) fn rate_lines(
    axes: &Axes,
    ticks: &[(f64, &TraceTick)],
    joints: Range<usize>,
    first: usize,
    of: fn(&TraceTick) -> &[f64],
) -> String {
    let line = |(i, index): (usize, usize)| {
        let points = ticks
            .iter()
            .step_by(4)
            .map(|(t, tick)| (*t, of(tick)[index]));
        axes.path(Curve::nth(first + i), &points.collect::<Vec<_>>())
    };
    joints.enumerate().map(line).collect()
}

/// Draws the costs of the exact plans of an arm; `None` for fewer than two.
fn plan_costs(trace: &Trace, arm: usize) -> Option<String> {
    let exact = |plan: &&TracePlan| plan.arm == arm && plan.cost < NEAR_MISS;
    let exact = trace.plans.iter().filter(exact);
    let costs: Vec<(f64, f64)> = exact.map(|plan| (plan.t, plan.cost)).collect();
    if costs.len() < 2 {
        return None;
    }
    let most = costs.iter().map(|(_, cost)| *cost).fold(0.1, f64::max);
    let axes = axes(
        140.0,
        time_axis(trace),
        Axis::linear("cost of the plan", 0.0..=(most * 5.0).ceil() / 5.0, 0.2),
    );
    let line = axes.line(Curve::nth(0), &costs, 1);
    Some(chart("Cost of plans", &axes, &line))
}
