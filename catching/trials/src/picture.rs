//! Drawing of a throw: robot and balls from the side, at several times.

use std::fmt::Write;

use nalgebra::Vector3;
use tactnet_catching::flight::BALL_RADIUS;
use tactnet_plot::{figure, stand_alone};

use crate::trace::{Trace, TraceTick};

/// Size of a drawing, in pixels.
pub(crate) const WIDTH: f64 = 760.0;
pub(crate) const HEIGHT: f64 = 330.0;
/// Scale, in pixels per metre.
const SCALE: f64 = 116.0;
/// Position of the robot's column and of the floor, in pixels.
const ORIGIN: (f64, f64) = (96.0, 296.0);
/// Time between two drawn balls, in s.
const BALL_EVERY: f64 = 0.04;
/// Time between two faint arms, in s.
const ARM_EVERY: f64 = 0.08;
/// Colour of the body, which hardly moves.
const BODY: &str = "#c3ccd4";
const ARM: &str = "#43596f";
const TITLE: &str = "Robot and balls from the side";

/// Returns a side view for a page with the style of figures: the robot at the throw (faint) and at the end, its arms
/// in between, and balls every 40 ms.
pub fn picture(trace: &Trace) -> Option<String> {
    Some(figure(WIDTH, HEIGHT, TITLE, &content(trace)?))
}

/// Returns the same drawing as a stand-alone file.
pub fn picture_file(trace: &Trace) -> Option<String> {
    Some(stand_alone(WIDTH, HEIGHT, TITLE, &content(trace)?))
}

pub(crate) fn content(trace: &Trace) -> Option<String> {
    let (first, last) = (trace.ticks.first()?, trace.ticks.last()?);
    let mut svg = ground();
    let period = |every: f64| {
        let tick = (last.t - first.t) / (trace.ticks.len() - 1).max(1) as f64;
        ((every / tick).round() as usize).max(1)
    };
    body(&mut svg, first, 0.15);
    let moments: Vec<&TraceTick> = trace.ticks.iter().step_by(period(ARM_EVERY)).collect();
    for (i, tick) in moments.iter().enumerate() {
        let opacity = 0.08 + 0.22 * (i + 1) as f64 / moments.len() as f64;
        for arm in tick.arms {
            limb(&mut svg, &arm, 0.045, ARM, opacity);
        }
    }
    body(&mut svg, last, 1.0);
    for arm in last.arms {
        limb(&mut svg, &arm, 0.06, "#fcfcfa", 0.8);
        limb(&mut svg, &arm, 0.045, ARM, 1.0);
    }
    for (ball, colour) in ["#c8551b", "#1b6fc8"].into_iter().enumerate() {
        let way = trace.ticks.iter().step_by(period(BALL_EVERY));
        for place in way.filter_map(|tick| tick.balls[ball]) {
            circle(&mut svg, &place, colour, 0.45);
        }
        // Position of the catch or on the floor.
        if let Some(place) = trace.ticks.iter().rev().find_map(|tick| tick.balls[ball]) {
            circle(&mut svg, &place, colour, 1.0);
        }
    }
    Some(svg)
}

fn at(point: &Vector3<f64>) -> (f64, f64) {
    (ORIGIN.0 + SCALE * point.x, ORIGIN.1 - SCALE * point.z)
}

/// Draws the floor, with distances from the robot in metres.
fn ground() -> String {
    let (left, floor) = ORIGIN;
    let mut svg = format!("<path class=\"grid\" d=\"M8 {floor}H{:.0}\"/>", WIDTH - 8.0);
    for metre in 0..=5 {
        let x = left + SCALE * f64::from(metre);
        let _ = write!(
            svg,
            "<path class=\"grid\" d=\"M{x:.0} {floor}v6\"/><text x=\"{x:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{metre} m</text>",
            floor + 22.0
        );
    }
    svg
}

/// Draws a chain of links with round ends; `radius` is in metres.
fn limb(svg: &mut String, points: &[Vector3<f64>], radius: f64, colour: &str, opacity: f64) {
    let mut path = String::new();
    for (i, point) in points.iter().enumerate() {
        let (x, y) = at(point);
        let _ = write!(path, "{}{x:.1} {y:.1}", if i == 0 { 'M' } else { 'L' });
    }
    let _ = write!(
        svg,
        "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{:.1}\" stroke-linecap=\"round\" stroke-linejoin=\"round\" \
         opacity=\"{opacity:.2}\"/>",
        2.0 * radius * SCALE
    );
}

/// Draws column, torso and head.
fn body(svg: &mut String, tick: &TraceTick, opacity: f64) {
    let [hip, knee, chest] = tick.torso;
    let foot = Vector3::new(hip.x, hip.y, 0.1);
    let _ = write!(svg, "<g opacity=\"{opacity:.2}\">");
    limb(svg, &[foot, hip], 0.12, BODY, 1.0);
    limb(svg, &[hip, knee, chest], 0.10, BODY, 1.0);
    limb(svg, &[chest, tick.head], 0.05, BODY, 1.0);
    let top = tick.head + Vector3::new(0.0, 0.0, 0.06);
    limb(svg, &[tick.head, top], 0.10, BODY, 1.0);
    svg.push_str("</g>");
}

fn circle(svg: &mut String, place: &Vector3<f64>, colour: &str, opacity: f64) {
    let (x, y) = at(place);
    let _ = write!(
        svg,
        "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\" fill=\"{colour}\" opacity=\"{opacity:.2}\"/>",
        BALL_RADIUS * SCALE
    );
}
