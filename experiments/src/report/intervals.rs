//! The accuracy of each row as a dot with its interval.
//!
//! Positions are percentages of the width, so the figure fits a phone without smaller letters.

use maud::{Markup, html};
use tactnet_plot::Scale;

use super::data_set::DataSet;
use super::text::{percent, shortened};
use crate::scored::Scored;

/// Width of the range above which only every second tenth has a grid line.
const WIDE: f64 = 0.65;

/// Returns the figure; `None` without results.
pub(super) fn section(sets: &[DataSet]) -> Option<Markup> {
    let rows = || sets.iter().flat_map(|set| set.rows.iter().copied());
    let range = Range::over(rows().flat_map(values))?;
    let published = rows().any(|row| row.published.is_some());
    let label = format!(
        "Accuracy of single sweeps, percent, one line for each of {} rows",
        rows().count()
    );
    Some(html! {
        figure {
            ul.intervals aria-label=(label) {
                @for set in sets {
                    li.strong { (set.heading()) }
                    @for row in set.contenders().into_iter().chain(set.probes()) { (line(&set.name(row), row, &range)) }
                }
                (range.axis())
            }
            figcaption {
                "Accuracy of single sweeps, %. Dot: mean; bar: 95\u{a0}% interval of the mean; small rings: folds"
                @if published { "; hollow diamond: published for TactMat" }
                ". The numbers are those of the table above."
            }
        }
    })
}

/// Returns all values of a row that have to fit into the figure.
fn values(row: &Scored<'_>) -> Vec<f64> {
    let mut values = row.one_sweep.values.clone();
    values.push(row.one_sweep.mean);
    values.extend(row.one_sweep.ci95.into_iter().flatten());
    values.extend(published(row));
    values
}

fn published(row: &Scored<'_>) -> Option<f64> {
    row.published
        .as_ref()
        .map(|published| published.one_sweep / 100.0)
}

/// Returns name, drawing and mean of a row; on a narrow screen the drawing is below the others.
fn line(name: &str, row: &Scored<'_>, range: &Range) -> Markup {
    let suffix = if row.probe && !name.contains("probe") {
        " (probe)"
    } else {
        ""
    };
    html! {
        li.row.probe[row.probe] {
            span { (shortened(&format!("{name}{suffix}"), 44)) }
            svg.figure aria-hidden="true" width="100%" height="30" {
                (range.grid())
                @for &fold in &row.one_sweep.values { circle.fold cx=(range.place(fold)) cy="15" r="3" {} }
                @if let Some([low, high]) = row.one_sweep.ci95 {
                    line.interval x1=(range.place(low)) x2=(range.place(high)) y1="15" y2="15" {}
                }
                circle.mean cx=(range.place(row.one_sweep.mean)) cy="15" r="4.5" {}
                @if let Some(share) = published(row) {
                    svg.mark x=(range.place(share)) y="15" { path.published d="M0-6 6 0 0 6-6 0z" {} }
                }
            }
            span.value { (percent(row.one_sweep.mean)) }
        }
    }
}

/// The drawn range of accuracies.
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    /// Returns the range of whole tens of percent around `values`, within 0 and 1; `None` without finite values.
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

    /// Returns the position of a value as a percentage of the figure's width.
    fn place(&self, value: f64) -> String {
        let share = Scale::Linear(self.low..=self.high)
            .share(value)
            .clamp(0.0, 1.0);
        format!("{:.2}%", 3.0 + 94.0 * share)
    }

    /// Returns the values with a grid line.
    fn ticks(&self) -> impl Iterator<Item = f64> {
        let tenths = ((self.high - self.low) * 10.0).round() as usize;
        let step = if self.high - self.low > WIDE { 2 } else { 1 };
        (0..=tenths)
            .step_by(step)
            .map(|tenth| self.low + tenth as f64 / 10.0)
    }

    fn grid(&self) -> Markup {
        html! {
            @for x in self.ticks().map(|value| self.place(value)) { line.grid x1=(x) x2=(x) y1="0" y2="100%" {} }
        }
    }

    fn axis(&self) -> Markup {
        html! {
            li.row {
                span {}
                svg.figure aria-hidden="true" width="100%" height="20" {
                    @for value in self.ticks() {
                        text.middle x=(self.place(value)) y="14" { (format!("{:.0}", 100.0 * value)) }
                    }
                }
            }
        }
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
