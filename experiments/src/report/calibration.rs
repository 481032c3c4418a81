//! How far a model's confidence can be trusted: reliability diagrams and risk-coverage curves.

use tactnet_plot::{Axes, Axis, Series, escape, figure, legend};

use super::data_set::DataSet;
use super::text::percent;
use crate::ReliabilityBin;
use crate::questions::Scored;

/// Bins of confidence in a summary.
const BINS: usize = 15;

/// Sweeps below which the accuracy of a bin is faint: its standard deviation is then up to 10 points.
const FEW: usize = 25;

/// Points of a curve that are drawn at most.
const POINTS: usize = 160;

/// Reliability of the best contender and of those behind it.
pub(super) fn reliability(set: &DataSet) -> String {
    let rows = shown(set, |row| !row.reliability.is_empty());
    let Some(best) = rows.first() else {
        return String::new();
    };
    let axes = square(
        Axis::percent("confidence, %", 1.0, 0.2),
        Axis::percent("accuracy, %", 1.0, 0.2),
    );
    let mut content = axes.grid();
    content.push_str(&format!(
        "<line class=\"diagonal\" x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\"/>\n",
        axes.x(0.0),
        axes.y(0.0),
        axes.x(1.0),
        axes.y(1.0)
    ));
    for (series, row) in rows.iter().enumerate().rev() {
        content.push_str(&bins(Series::nth(series), row.reliability, &axes));
    }
    content.push_str(&counts(best.reliability, &axes));
    let name = set.name(best);
    let title = format!("Reliability of {name} on {}", set.heading());
    format!(
        "<figure>\n{}{}<figcaption>Reliability: accuracy against mean confidence in {BINS} bins; on the dashed diagonal \
         confidence is deserved, below it is overconfidence. Bins of fewer than {FEW} sweeps are faint. Bars: sweeps of {} in each bin. ECE of {}: {}\u{a0}%.</figcaption>\n</figure>\n",
        figure(400.0, 474.0, &title, &content),
        names(set, &rows),
        escape(&name),
        escape(&name),
        percent(best.expected_calibration_error.mean)
    )
}

/// Risk against coverage for the best contender and those behind it.
pub(super) fn risk_coverage(set: &DataSet) -> String {
    let rows = shown(set, |row| !row.risk_coverage.is_empty());
    let Some(best) = rows.first() else {
        return String::new();
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
    let title = format!(
        "Risk against coverage on {}, best: {}",
        set.heading(),
        set.name(best)
    );
    format!(
        "<figure>\n{}{}<figcaption>Risk and coverage: the error that remains when only the most confident sweeps are answered. \
         Lower is better; the right end is the error of answering always.</figcaption>\n</figure>\n",
        figure(400.0, 400.0, &title, &content),
        names(set, &rows)
    )
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

/// The best contenders that have what is to be drawn.
fn shown<'a>(set: &DataSet<'a>, drawable: impl Fn(&Scored<'_>) -> bool) -> Vec<&'a Scored<'a>> {
    set.contenders()
        .into_iter()
        .filter(|row| drawable(row))
        .take(Series::COUNT)
        .collect()
}

fn names(set: &DataSet, rows: &[&Scored<'_>]) -> String {
    let names: Vec<String> = rows.iter().map(|row| set.name(row)).collect();
    legend(&names)
}

/// Accuracy of the bins; those of few sweeps, and the lines that end there, are faint.
fn bins(series: Series, bins: &[ReliabilityBin], axes: &Axes) -> String {
    let mut svg = String::new();
    let point = |bin: &ReliabilityBin| (bin.confidence, bin.accuracy);
    let enough = |bin: &ReliabilityBin| bin.count >= FEW;
    for pair in bins.windows(2) {
        let line = axes.path(series, &[point(&pair[0]), point(&pair[1])]);
        svg.push_str(&faint(!pair.iter().all(enough), line));
    }
    for bin in bins {
        let (x, y) = point(bin);
        let marker = series.group(&series.marker(axes.x(x), axes.y(y)));
        svg.push_str(&faint(!enough(bin), marker));
    }
    svg
}

fn faint(is_faint: bool, content: String) -> String {
    if is_faint {
        format!("<g class=\"faint\">{content}</g>")
    } else {
        content
    }
}

/// Bars below the horizontal axis: sweeps in each bin.
fn counts(bins: &[ReliabilityBin], axes: &Axes) -> String {
    let (ground, tallest) = (axes.top + axes.height + 112.0, 56.0);
    let largest = bins.iter().map(|bin| bin.count).max().unwrap_or(0).max(1);
    let width = axes.width / BINS as f64;
    let bars: String = bins
        .iter()
        .map(|bin| {
            let place = ((bin.confidence * BINS as f64) as usize).min(BINS - 1);
            let height = tallest * bin.count as f64 / largest as f64;
            format!(
                "<rect{} x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{height:.1}\"><title>{} sweeps</title></rect>\n",
                if bin.count < FEW { " class=\"faint\"" } else { "" },
                axes.left + width * place as f64 + 1.0,
                ground - height,
                width - 2.0,
                bin.count
            )
        })
        .collect();
    format!(
        "<g class=\"counts\">{bars}</g><line class=\"grid\" x1=\"{:.1}\" x2=\"{:.1}\" y1=\"{ground:.1}\" y2=\"{ground:.1}\"/>\
         <text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{largest}</text><text class=\"end\" x=\"{:.1}\" y=\"{ground:.1}\">0</text>\
         <text class=\"middle label\" transform=\"translate(12 {:.1}) rotate(-90)\">sweeps</text>\n",
        axes.left,
        axes.left + axes.width,
        axes.left - 6.0,
        ground - tallest + 8.0,
        axes.left - 6.0,
        ground - tallest / 2.0
    )
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
        );
        // One marker and the line that leads to it.
        assert_eq!(svg.matches("class=\"faint\"").count(), 2);
        assert_eq!(svg.matches("<polyline").count(), 3);
        assert_eq!(svg.matches("<circle").count(), 4);
    }
}
