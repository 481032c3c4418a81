//! Calibration of a model's confidence: reliability diagrams and risk-coverage curves.

use maud::{Markup, PreEscaped, html};
use tactnet_plot::{Axes, Axis, Series, figure, legend};

use super::data_set::DataSet;
use super::text::{percent, px};
use crate::ReliabilityBin;
use crate::scored::Scored;

/// Number of confidence bins in a summary.
const BINS: usize = 15;

/// Number of sweeps below which a bin is drawn faint: the standard deviation of its accuracy is then up to 10 points.
const FEW: usize = 25;

/// Maximum number of drawn points of a curve.
const POINTS: usize = 160;

/// Returns the reliability diagram of the best contenders.
pub(super) fn reliability(set: &DataSet) -> Markup {
    let rows = shown(set, |row| !row.reliability.is_empty());
    let Some(best) = rows.first() else {
        return html! {};
    };
    let axes = square(
        Axis::percent("confidence, %", 1.0, 0.2),
        Axis::percent("accuracy, %", 1.0, 0.2),
    );
    let content = html! {
        (PreEscaped(axes.grid()))
        line.diagonal x1=(px(axes.x(0.0))) y1=(px(axes.y(0.0))) x2=(px(axes.x(1.0))) y2=(px(axes.y(1.0))) {}
        @for (series, row) in rows.iter().enumerate().rev() { (bins(Series::nth(series), &row.reliability, &axes)) }
        (counts(&best.reliability, &axes))
    };
    let name = set.name(best);
    let title = format!("Reliability of {name} on {}", set.heading());
    html! {
        figure {
            (PreEscaped(figure(400.0, 474.0, &title, &content.0)))
            (names(set, &rows))
            figcaption {
                "Reliability: accuracy against mean confidence in " (BINS) " bins. Calibrated confidence lies on the dashed "
                "diagonal, overconfidence below it. Bins of fewer than " (FEW) " sweeps are faint. Bars: sweeps of " (name)
                " in each bin. ECE of " (name) ": " (percent(best.expected_calibration_error.mean)) "\u{a0}%."
            }
        }
    }
}

/// Returns the risk-coverage curves of the best contenders.
pub(super) fn risk_coverage(set: &DataSet) -> Markup {
    let rows = shown(set, |row| !row.risk_coverage.is_empty());
    let Some(best) = rows.first() else {
        return html! {};
    };
    let largest = rows
        .iter()
        .flat_map(|row| row.risk_coverage.iter())
        .map(|point| point.risk)
        .fold(0.05, f64::max);
    let step = if largest > 0.5 {
        0.2
    } else if largest > 0.2 {
        0.1
    } else {
        0.05
    };
    let most = ((largest / step).ceil() * step).min(1.0);
    let axes = square(
        Axis::percent("answered, %", 1.0, 0.2),
        Axis::percent("wrong among the answered, %", most, step),
    );
    let mut content = axes.grid();
    for (series, row) in rows.iter().enumerate().rev() {
        let every = row.risk_coverage.len().div_ceil(POINTS);
        let points: Vec<(f64, f64)> = row
            .risk_coverage
            .iter()
            .enumerate()
            .filter(|(k, _)| k % every == 0 || k + 1 == row.risk_coverage.len())
            .map(|(_, point)| (point.coverage, point.risk))
            .collect();
        content.push_str(&axes.line(Series::nth(series), &points, points.len().div_ceil(8)));
    }
    let (data, name) = (set.heading(), set.name(best));
    let title = format!("Risk against coverage on {data}, best: {name}");
    html! {
        figure {
            (PreEscaped(figure(400.0, 400.0, &title, &content)))
            (names(set, &rows))
            figcaption {
                "Risk and coverage: the remaining error if only the most confident sweeps are answered. Lower is better; the "
                "right end is the error without rejection."
            }
        }
    }
}

fn square(horizontal: Axis, vertical: Axis) -> Axes {
    Axes {
        left: 52.0,
        top: 10.0,
        width: 336.0,
        height: 336.0,
        horizontal,
        vertical,
    }
}

/// Returns the best contenders that have something to draw.
fn shown<'a>(set: &DataSet<'a>, drawable: impl Fn(&Scored<'_>) -> bool) -> Vec<&'a Scored<'a>> {
    set.contenders()
        .into_iter()
        .filter(|row| drawable(row))
        .take(Series::COUNT)
        .collect()
}

fn names(set: &DataSet, rows: &[&Scored<'_>]) -> Markup {
    let names: Vec<String> = rows.iter().map(|row| set.name(row)).collect();
    PreEscaped(legend(&names))
}

/// Draws the accuracy of bins; bins of few sweeps, and lines that end there, are faint.
fn bins(series: Series, bins: &[ReliabilityBin], axes: &Axes) -> Markup {
    let point = |bin: &ReliabilityBin| (bin.confidence, bin.accuracy);
    let enough = |bin: &ReliabilityBin| bin.count >= FEW;
    let marker = |bin: &ReliabilityBin| {
        let (x, y) = point(bin);
        series.group(&series.marker(axes.x(x), axes.y(y)))
    };
    html! {
        @for pair in bins.windows(2) {
            (faint(!pair.iter().all(enough), axes.path(series, &[point(&pair[0]), point(&pair[1])])))
        }
        @for bin in bins { (faint(!enough(bin), marker(bin))) }
    }
}

fn faint(is_faint: bool, content: String) -> Markup {
    html! {
        @if is_faint { g.faint { (PreEscaped(content)) } } @else { (PreEscaped(content)) }
    }
}

/// Draws bars below the horizontal axis with the number of sweeps in each bin.
fn counts(bins: &[ReliabilityBin], axes: &Axes) -> Markup {
    let (ground, tallest) = (axes.top + axes.height + 112.0, 56.0);
    let largest = bins.iter().map(|bin| bin.count).max().unwrap_or(0).max(1);
    let width = axes.width / BINS as f64;
    let height = |bin: &ReliabilityBin| tallest * bin.count as f64 / largest as f64;
    let left = |bin: &ReliabilityBin| {
        let place = ((bin.confidence * BINS as f64) as usize).min(BINS - 1);
        axes.left + width * place as f64 + 1.0
    };
    let (start, end) = (px(axes.left), px(axes.left + axes.width));
    let labels = px(axes.left - 6.0);
    let title = format!("translate(12 {}) rotate(-90)", px(ground - tallest / 2.0));
    html! {
        g.counts {
            @for bin in bins {
                rect class=[(bin.count < FEW).then_some("faint")] x=(px(left(bin))) y=(px(ground - height(bin))) width=(px(width - 2.0))
                    height=(px(height(bin))) { title { (bin.count) " sweeps" } }
            }
        }
        line.grid x1=(start) x2=(end) y1=(px(ground)) y2=(px(ground)) {}
        text.end x=(labels) y=(px(ground - tallest + 8.0)) { (largest) }
        text.end x=(labels) y=(px(ground)) { "0" }
        text.middle.label transform=(title) { "sweeps" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_of_few_sweeps_are_faint() {
        let axes = square(Axis::percent("x", 1.0, 0.2), Axis::percent("y", 1.0, 0.2));
        let bin = |confidence, count| ReliabilityBin {
            confidence,
            accuracy: 0.5,
            count,
        };
        let svg = bins(
            Series::nth(0),
            &[
                bin(0.3, FEW - 1),
                bin(0.5, FEW),
                bin(0.7, FEW),
                bin(0.9, 900),
            ],
            &axes,
        )
        .into_string();
        // One marker and the line that leads to it.
        assert_eq!(svg.matches("class=\"faint\"").count(), 2);
        assert_eq!(svg.matches("<polyline").count(), 3);
        assert_eq!(svg.matches("<circle").count(), 4);
    }
}
