//! Accuracy of every row as a dot with its interval.
//!
//! Positions are percentages of the width, so that the figure fills a phone without shrinking its letters.

use tactnet_plot::{Scale, escape};

use super::data_set::DataSet;
use super::text::{percent, shortened};
use crate::questions::Scored;

const HEADING: f64 = 42.0;
const LINE: f64 = 40.0;

/// Ranges above this have a grid line at every second tenth only.
const WIDE: f64 = 0.65;

/// Returns the figure; `None` before anything has ended.
pub(super) fn section(sets: &[DataSet]) -> Option<String> {
    let rows = || sets.iter().flat_map(|set| set.rows.iter().copied());
    let range = Range::over(rows().flat_map(values))?;
    let mut y = 0.0;
    let mut content = String::new();
    for set in sets {
        y += HEADING;
        content.push_str(&format!(
            "<text class=\"strong\" x=\"0\" y=\"{:.0}\">{}</text>\n",
            y - 10.0,
            escape(&set.heading())
        ));
        for row in set.contenders().into_iter().chain(set.probes()) {
            content.push_str(&line(&set.name(row), row, y, &range));
            y += LINE;
        }
    }
    let axis = range.axis(y);
    let diamond = if rows().any(|row| row.published.is_some()) {
        "; hollow diamond: published for TactMat"
    } else {
        ""
    };
    Some(format!(
        "<figure>\n<svg class=\"figure fluid\" role=\"img\" width=\"100%\" height=\"{:.0}\"><title>Accuracy of single sweeps, \
         percent, one line for each of {} rows</title>\n{axis}{content}</svg>\n\
         <figcaption>Accuracy of single sweeps, %. Dot: mean; bar: 95\u{a0}% interval of the mean; small rings: folds{diamond}. The numbers are those of the table above.</figcaption>\n</figure>\n",
        y + 24.0,
        rows().count()
    ))
}

/// Everything of a row that has to fit into the figure.
fn values(row: &Scored<'_>) -> Vec<f64> {
    let mut values = row.one_sweep.values.clone();
    values.push(row.one_sweep.mean);
    values.extend(row.one_sweep.ci95.into_iter().flatten());
    values.extend(published(row));
    values
}

fn published(row: &Scored<'_>) -> Option<f64> {
    row.published.map(|published| published.one_sweep / 100.0)
}

fn line(name: &str, row: &Scored<'_>, y: f64, range: &Range) -> String {
    let class = if row.probe { "row probe" } else { "row" };
    let name = if row.probe && !name.contains("probe") {
        format!("{name} (probe)")
    } else {
        name.to_string()
    };
    let (label, middle) = (y + 12.0, y + 24.0);
    let mut svg = format!(
        "<g class=\"{class}\"><text x=\"0\" y=\"{label:.0}\">{}</text><text class=\"end\" x=\"100%\" y=\"{label:.0}\">{}</text>\n",
        escape(&shortened(&name, 44)),
        percent(row.one_sweep.mean)
    );
    for &fold in &row.one_sweep.values {
        svg.push_str(&format!(
            "<circle class=\"fold\" cx=\"{}\" cy=\"{middle:.0}\" r=\"3\"/>",
            range.place(fold)
        ));
    }
    if let Some([low, high]) = row.one_sweep.ci95 {
        svg.push_str(&format!(
            "<line class=\"interval\" x1=\"{}\" x2=\"{}\" y1=\"{middle:.0}\" y2=\"{middle:.0}\"/>",
            range.place(low),
            range.place(high)
        ));
    }
    svg.push_str(&format!(
        "<circle class=\"mean\" cx=\"{}\" cy=\"{middle:.0}\" r=\"4.5\"/>",
        range.place(row.one_sweep.mean)
    ));
    if let Some(share) = published(row) {
        svg.push_str(&format!(
            "<svg class=\"mark\" x=\"{}\" y=\"{middle:.0}\"><path class=\"published\" d=\"M0-6 6 0 0 6-6 0z\"/></svg>",
            range.place(share)
        ));
    }
    svg.push_str("</g>\n");
    svg
}

/// The range of accuracies that is drawn.
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    /// Whole tens of percent around `values`, within 0 and 1.
    fn over(values: impl Iterator<Item = f64>) -> Option<Self> {
        let (low, high) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            });
        if low > high {
            return None;
        }
        let low = ((10.0 * low).floor() / 10.0).clamp(0.0, 0.9);
        let low = if high - low > WIDE {
            (5.0 * low).floor() / 5.0
        } else {
            low
        };
        let high = ((10.0 * high).ceil() / 10.0).clamp(low + 0.1, 1.0);
        Some(Self { low, high })
    }

    /// Position of a value, percent of the figure's width.
    fn place(&self, value: f64) -> String {
        let share = Scale::Linear(self.low..=self.high)
            .share(value)
            .clamp(0.0, 1.0);
        format!("{:.2}%", 3.0 + 94.0 * share)
    }

    fn axis(&self, bottom: f64) -> String {
        let tenths = ((self.high - self.low) * 10.0).round() as usize;
        let step = if self.high - self.low > WIDE { 2 } else { 1 };
        (0..=tenths)
            .step_by(step)
            .map(|tenth| {
                let value = self.low + tenth as f64 / 10.0;
                let x = self.place(value);
                format!(
                    "<line class=\"grid\" x1=\"{x}\" x2=\"{x}\" y1=\"{HEADING}\" y2=\"{bottom:.0}\"/>\
                     <text class=\"middle\" x=\"{x}\" y=\"{:.0}\">{:.0}</text>\n",
                    bottom + 17.0,
                    100.0 * value
                )
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_range_covers_every_value_in_whole_tens() {
        let range = Range::over([0.83, 0.91, f64::NAN].into_iter()).unwrap();
        assert!((range.low - 0.8).abs() < 1e-12 && (range.high - 1.0).abs() < 1e-12);
        assert_eq!(range.place(0.8), "3.00%");
        assert_eq!(range.place(1.2), "97.00%");
        assert!(Range::over([].into_iter()).is_none());
    }
}
