//! Desired and measured velocity ramps of one catch (thesis, figure 3.12).

use std::fmt::Write;
use std::ops::Range;

use tactnet_catching_packets::joint;
use tactnet_plot::{Axes, Axis, key, stand_alone};

use super::page::rate_lines;
use super::{Series, SeriesReport};
use crate::error::TrialError;
use crate::trace::{Trace, TracePlan, TraceTick};
use tactnet_plot::report::LEFT;

/// Time for which the ramps continue after the catch, in s; then the robot goes back.
const AFTER: f64 = 0.35;
/// Width of axes, and of a column with its legend, in pixels.
const WIDTH: f64 = 400.0;
const COLUMN: f64 = LEFT + WIDTH + 175.0;
/// Height of the picture and of the labels of a panel, in pixels.
const HEIGHT: f64 = 660.0;
const LABELS: f64 = 60.0;

/// Rates of a group of joints.
struct Panel<'a> {
    label: String,
    joints: Range<usize>,
    /// Names of the lines: of the desired rates, then of the measured ones.
    names: &'a [&'a str],
    desired: bool,
    measured: bool,
}

impl Series {
    /// Simulates the throw of [`Series::drawn`] again and returns a file with the velocity ramps of the arm that
    /// catches, torso, head and platform over the time to the catch. `None` without a plan.
    ///
    /// # Errors
    /// Same as [`Series::run`].
    pub fn ramps_picture(&self, report: &SeriesReport) -> Result<Option<String>, TrialError> {
        let Some(number) = report.drawn() else {
            return Ok(None);
        };
        let trace = self.again(number, AFTER)?;
        let plan = trace.plans.last().copied();
        Ok(plan.map(|plan| picture(&trace, number, &plan)))
    }
}

fn picture(trace: &Trace, number: u64, plan: &TracePlan) -> String {
    let arm = ["left", "right"][plan.arm];
    let joints = ["1", "2", "3", "4", "5", "6", "7"].map(|i| format!("joint {i}"));
    let joints = joints.each_ref().map(String::as_str);
    let of_arm = |desired: bool, what: &str| Panel {
        label: format!("{arm} arm, {what} [rad/s]"),
        joints: joint::ARM[plan.arm].clone(),
        names: &joints,
        desired,
        measured: !desired,
    };
    let both = |label: &str, joints, names| Panel {
        label: label.into(),
        joints,
        names,
        desired: true,
        measured: true,
    };
    let left = [of_arm(true, "desired"), of_arm(false, "measured")];
    let torso = [
        "vertical",
        "lower pitch",
        "upper pitch",
        "vertical, measured",
        "lower, measured",
        "upper, measured",
    ];
    let right = [
        both("torso [rad/s]", joint::TORSO, &torso),
        both(
            "head [rad/s]",
            joint::NECK,
            &["pan", "tilt", "pan, measured", "tilt, measured"],
        ),
        both(
            "platform [m/s]",
            joint::PLATFORM..joint::PLATFORM + 1,
            &["sideways", "measured"],
        ),
    ];
    let mut svg = format!(
        "<text x=\"12\" y=\"20\">throw {number}: desired and measured rates; commands lead the drives by their delay; dashed: the last \
         correction and the catch</text>"
    );
    for (column, panels) in [&left[..], &right[..]].into_iter().enumerate() {
        let height = (HEIGHT - 30.0) / panels.len() as f64;
        for (row, panel) in panels.iter().enumerate() {
            let place = (column as f64 * COLUMN, 34.0 + row as f64 * height);
            svg += &panel.draw(trace, plan, place, height - LABELS);
        }
    }
    let title = "Desired and measured velocity ramps of a catch";
    stand_alone(2.0 * COLUMN, HEIGHT + 10.0, title, &svg)
}

impl Panel<'_> {
    fn draw(
        &self,
        trace: &Trace,
        plan: &TracePlan,
        (left, top): (f64, f64),
        height: f64,
    ) -> String {
        let peak = trace.ticks.iter().flat_map(|tick| {
            let rates = tick.commanded[self.joints.clone()].iter();
            rates.chain(&tick.measured[self.joints.clone()])
        });
        let peak = peak.fold(0.0, |most: f64, rate| most.max(rate.abs()));
        let step = [0.1, 0.2, 0.5, 1.0]
            .into_iter()
            .find(|step| peak <= 3.0 * step);
        let step = step.unwrap_or(2.0);
        let most = step * (peak / step).ceil().max(1.0);
        let begin = -(plan.catch * 10.0).ceil() / 10.0;
        let axes = Axes {
            left: left + LEFT,
            top,
            width: WIDTH,
            height,
            horizontal: Axis::linear("time to the catch [s]", begin..=AFTER, 0.2),
            vertical: Axis::linear(&self.label, -most..=most, step),
        };
        let times = trace.ticks.iter().map(|tick| (tick.t - plan.catch, tick));
        let ticks: Vec<_> = times.filter(|(t, _)| *t < AFTER).collect();
        let lines = |first: usize, of: fn(&TraceTick) -> &[f64]| {
            rate_lines(&axes, &ticks, self.joints.clone(), first, of)
        };
        let mut svg = axes.grid();
        let mut first = 0;
        if self.desired {
            svg += &lines(first, |tick| &tick.commanded);
            first += self.joints.len();
        }
        if self.measured {
            svg += &lines(first, |tick| &tick.measured);
        }
        for t in [plan.t - plan.catch, 0.0] {
            let x = axes.x(t);
            let _ = write!(
                svg,
                "<path d=\"M{x:.1} {top:.1}v{height:.1}\" stroke=\"#55595e\" stroke-dasharray=\"3 3\"/>"
            );
        }
        svg + &key(self.names, left + LEFT + WIDTH + 12.0, top)
    }
}
