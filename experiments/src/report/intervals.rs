//! Accuracy of every row as a dot with its interval.
//!
//! Positions are percentages of the width, so that the figure fills a phone without shrinking its letters.

use tactnet_plot::{Scale, escape};

use super::data_set::DataSet;
use super::text::{percent, shortened};
use crate::questions::Scored;

/// Height of a row's drawing, px.
const LINE: f64 = 30.0;

/// Ranges above this have a grid line at every second tenth only.
const WIDE: f64 = 0.65;

/// Returns the figure; `None` before anything has ended.
pub(super) fn section(sets: &[DataSet]) -> Option<String> {
    let rows = || sets.iter().flat_map(|set| set.rows.iter().copied());
    let range = Range::over(rows().flat_map(values))?;
    let mut content = String::new();
    for set in sets {
        content.push_str(&format!(
            "<li class=\"strong\">{}</li>\n",
            escape(&set.heading())
        ));
        for row in set.contenders().into_iter().chain(set.probes()) {
            content.push_str(&line(&set.name(row), row, &range));
        }
    }
    let diamond = if rows().any(|row| row.published.is_some()) {
        "; hollow diamond: published for TactMat"
    } else {
        ""
    };
    Some(format!(
        "<figure>\n<ul class=\"intervals\" aria-label=\"Accuracy of single sweeps, percent, one line for each of {} rows\">\n{content}{}</ul>\n\
         <figcaption>Accuracy of single sweeps, %. Dot: mean; bar: 95\u{a0}% interval of the mean; small rings: folds{diamond}. The numbers are those of the table above.</figcaption>\n</figure>\n",
        rows().count(),
        range.axis()
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

/// The name, the drawing, the mean: beside each other, or on a narrow screen the drawing below the two others.
fn line(name: &str, row: &Scored<'_>, range: &Range) -> String {
    let class = if row.probe { "row probe" } else { "row" };
    let name = if row.probe && !name.contains("probe") {
        format!("{name} (probe)")
    } else {
        name.to_string()
    };
    let middle = LINE / 2.0;
    let mut html = format!(
        "<li class=\"{class}\"><span>{}</span>\
         <svg class=\"figure\" aria-hidden=\"true\" width=\"100%\" height=\"{LINE:.0}\">{}",
        escape(&shortened(&name, 44)),
        range.grid()
    );
    for &fold in &row.one_sweep.values {
        html.push_str(&format!(
            "<circle class=\"fold\" cx=\"{}\" cy=\"{middle:.0}\" r=\"3\"/>",
            range.place(fold)
        ));
    }
    if let Some([low, high]) = row.one_sweep.ci95 {
        html.push_str(&format!(
            "<line class=\"interval\" x1=\"{}\" x2=\"{}\" y1=\"{middle:.0}\" y2=\"{middle:.0}\"/>",
            range.place(low),
            range.place(high)
        ));
    }
    html.push_str(&format!(
        "<circle class=\"mean\" cx=\"{}\" cy=\"{middle:.0}\" r=\"4.5\"/>",
        range.place(row.one_sweep.mean)
    ));
    if let Some(share) = published(row) {
        html.push_str(&format!(
            "<svg class=\"mark\" x=\"{}\" y=\"{middle:.0}\"><path class=\"published\" d=\"M0-6 6 0 0 6-6 0z\"/></svg>",
            range.place(share)
        ));
    }
    html.push_str(&format!(
        "</svg><span class=\"value\">{}</span></li>\n",
        percent(row.one_sweep.mean)
    ));
    html
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

    /// Values at which there is a grid line.
    fn ticks(&self) -> impl Iterator<Item = f64> {
        let tenths = ((self.high - self.low) * 10.0).round() as usize;
        let step = if self.high - self.low > WIDE { 2 } else { 1 };
        (0..=tenths)
            .step_by(step)
            .map(|tenth| self.low + tenth as f64 / 10.0)
    }

    fn grid(&self) -> String {
        let lines = self.ticks().map(|value| {
            let x = self.place(value);
            format!("<line class=\"grid\" x1=\"{x}\" x2=\"{x}\" y1=\"0\" y2=\"100%\"/>")
        });
        lines.collect()
    }

    fn axis(&self) -> String {
        let labels = self.ticks().map(|value| {
            let x = self.place(value);
            format!(
                "<text class=\"middle\" x=\"{x}\" y=\"14\">{:.0}</text>",
                100.0 * value
            )
        });
        format!(
            "<li class=\"row\"><span></span><svg class=\"figure\" aria-hidden=\"true\" width=\"100%\" height=\"20\">{}</svg></li>\n",
            labels.collect::<String>()
        )
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
