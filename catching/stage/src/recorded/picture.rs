//! Figure of the timing of a recording, after figure 3.2 of the thesis.

use std::fmt::Write;

use tactnet_plot::{escape, stand_alone};

use super::{Step, Timing};

const WIDTH: f64 = 760.0;
/// Left end of the time axis, in pixels.
const LEFT: f64 = 190.0;
const RIGHT: f64 = 744.0;
const TOP: f64 = 44.0;
const ROW: f64 = 34.0;
/// Time from exposure to path in the thesis (figure 3.2), in ms: 40 camera, 35 detector and tracker, 17 transfers, 60
/// planning.
const THESIS_MS: f64 = 152.0;
/// Distance between two axis ticks, in ms.
const TICK: f64 = 20.0;

impl Timing {
    /// Returns the steps from an exposure to its path as an SVG file. Bars end at the medians, whiskers at the 99th
    /// percentiles.
    pub fn picture(&self) -> String {
        let slowest = self.steps.iter().map(|step| step.ends_ms.p99);
        let most = slowest.fold(THESIS_MS, f64::max) / TICK;
        let axis = TimeAxis {
            most: (most.floor() + 1.0) * TICK,
            bottom: TOP + ROW * self.steps.len() as f64,
        };
        let mut svg = axis.grid();
        svg += &axis.mark(THESIS_MS, 1, "path in the thesis, at worst: 152 ms");
        let mut begins = 0.0;
        for (row, step) in self.steps.iter().enumerate() {
            svg += &axis.bar(row, begins, step);
            begins = step.ends_ms.p50;
        }
        let _ = writeln!(
            svg,
            "<text class=\"label middle\" x=\"{:.0}\" y=\"{:.0}\">ms after the middle of the exposure ({} paths)</text>",
            (LEFT + RIGHT) / 2.0,
            axis.bottom + 36.0,
            self.paths
        );
        let title = "From an exposure to the path that follows from it, step by step";
        stand_alone(WIDTH, axis.bottom + 50.0, title, &svg)
    }
}

struct TimeAxis {
    /// End, in ms.
    most: f64,
    /// Position of the axis, in pixels.
    bottom: f64,
}

impl TimeAxis {
    fn x(&self, ms: f64) -> f64 {
        LEFT + (RIGHT - LEFT) * ms / self.most
    }

    fn grid(&self) -> String {
        let bottom = self.bottom;
        let mut svg = String::new();
        let mut tick = 0.0;
        while tick <= self.most {
            let at = self.x(tick);
            let _ = write!(
                svg,
                "<path class=\"grid\" d=\"M{at:.1} {TOP}V{bottom:.0}\"/><text class=\"label middle\" x=\"{at:.1}\" y=\"{:.0}\">{tick:.0}</text>",
                bottom + 17.0
            );
            tick += TICK;
        }
        svg
    }

    /// Draws a vertical line with a text.
    fn mark(&self, ms: f64, series: usize, text: &str) -> String {
        let at = self.x(ms);
        format!(
            "<g class=\"series s{series}\"><polyline points=\"{at:.1},{:.0} {at:.1},{:.0}\"/></g><text class=\"end\" x=\"{:.1}\" y=\"{:.0}\">{}</text>",
            TOP - 12.0,
            self.bottom,
            at - 5.0,
            TOP - 8.0,
            escape(text)
        )
    }

    fn bar(&self, row: usize, begins: f64, step: &Step) -> String {
        let middle = TOP + ROW * (row as f64 + 0.5);
        let [from, to, late] = [begins, step.ends_ms.p50, step.ends_ms.p99].map(|ms| self.x(ms));
        format!(
            "<text class=\"end\" x=\"{:.0}\" y=\"{:.1}\">{}</text><text class=\"label end\" x=\"{:.0}\" y=\"{:.1}\">{}</text>\
             <g class=\"series s0\"><rect x=\"{from:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"14\"/>\
             <path class=\"range\" fill=\"none\" d=\"M{to:.1} {middle:.1}H{late:.1}M{late:.1} {:.1}v8\"/></g>\
             <text x=\"{:.1}\" y=\"{:.1}\">{:.1} ms, 99 % {:.1}</text>",
            LEFT - 10.0,
            middle - 2.0,
            escape(step.name),
            LEFT - 10.0,
            middle + 12.0,
            escape(step.process),
            middle - 7.0,
            (to - from).max(1.0),
            middle - 4.0,
            late + 7.0,
            middle + 4.0,
            step.takes_ms.p50,
            step.takes_ms.p99,
        )
    }
}
