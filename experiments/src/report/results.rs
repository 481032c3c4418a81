//! The table of results: one line a model, grouped by what may be compared.

use tactnet_plot::escape;

use super::data_set::{DataSet, split_name};
use super::text::{ABSENT, decimal, percent, percent_and_sd, percent_interval, prose, scroll};
use crate::Statistic;
use crate::interval_note::interval_notes;
use crate::questions::{Scored, few_steps};

use Heading::{Number, Score, Text};

/// Returns the table, `None` before anything has ended. Columns that say the same of every row are a sentence above it.
pub(super) fn section(contenders: &[Scored<'_>], sets: &[DataSet]) -> Option<String> {
    let first = contenders.first()?;
    let published = contenders.iter().any(|row| row.published.is_some());
    let steps = contenders.iter().any(|row| row.steps != first.steps);
    let mut headings = vec![
        Text("Model"),
        Score("1 sweep<br><small>% (sd)</small>"),
        Number("95 % interval<br><small>1 sweep, %</small>"),
        Number("3 sweeps<br><small>% (sd)</small>"),
        Number("3 sweeps, vote<br><small>% (sd)</small>"),
        Number("\u{3c3}<sub>test</sub><br><small>%</small>"),
        Number("NLL<br><small>nats</small>"),
        Number("ECE<br><small>%</small>"),
        Number("Brier<br><small>0 to 2</small>"),
        Number("Training<br><small>s/fold</small>"),
        Number("Folds"),
    ];
    if steps {
        headings.push(Number("Steps"));
    }
    if published {
        headings.push(Number("1 sweep, %<br><small>published, TactMat</small>"));
        headings.push(Number("3 sweeps, %<br><small>published, TactMat</small>"));
    }
    let bodies: String = sets
        .iter()
        .flat_map(|set| [(set, false), (set, true)])
        .filter_map(|(set, probes)| {
            let rows = if probes {
                set.probes()
            } else {
                set.contenders()
            };
            let lines: String = rows
                .iter()
                .map(|row| {
                    // A row's folds are found by its place in the summary.
                    let index = contenders.iter().position(|other| other.key == row.key);
                    line(index.unwrap_or_default(), set, row, (steps, published))
                })
                .collect();
            let of = match (probes, sets.len()) {
                (false, 1) => None,
                (false, _) => Some(set.heading()),
                (true, 1) => Some("Probes: what the data give away, not contenders".into()),
                (true, _) => Some(format!("Probes on {}", set.heading())),
            };
            (!rows.is_empty()).then(|| body(of.as_deref(), headings.len(), &lines))
        })
        .collect();
    let table = format!(
        "<table class=\"sortable results\">\n<caption class=\"hidden\">Accuracy and calibration of every model</caption>\n\
         <thead><tr>{}</tr></thead>\n{bodies}</table>\n",
        sortable(&headings),
    );
    Some(format!(
        "<p>{} Means over folds, most accurate first. Intervals know that folds share training sweeps (Nadeau and Bengio, 2003). For NLL, \
         ECE and Brier, smaller is better. A model's name leads to its folds.</p>\n{}{}",
        alike(contenders, sets),
        scroll("Results table", &table),
        notes(contenders)
    ))
}

/// What qualifies rows of the table: intervals that are missing or wide, networks that had few steps to learn in.
fn notes(contenders: &[Scored<'_>]) -> String {
    let rows = contenders.iter().map(|row| (row.name(), row.one_sweep));
    let mut lines = interval_notes(rows, "fold");
    lines.extend(few_steps(contenders));
    lines
        .iter()
        .map(|line| format!("<p class=\"note\">{}</p>\n", prose(line)))
        .collect()
}

/// What every row has in common, as a sentence.
fn alike(contenders: &[Scored<'_>], sets: &[DataSet]) -> String {
    let mut common = Vec::new();
    if let [set] = sets {
        common.push(set.heading());
    }
    if let [first, rest @ ..] = contenders {
        if rest.iter().all(|row| row.split == first.split) {
            common.push(split_name(first.split));
        }
        if rest.iter().all(|row| row.steps == first.steps) {
            common.push(format!("{} time steps", first.steps));
        }
    }
    if common.is_empty() {
        String::new()
    } else {
        format!("All rows: {}.", escape(&common.join(", ")))
    }
}

/// Lines of a table under a heading of their own; sorting keeps them together.
pub(super) fn body(heading: Option<&str>, columns: usize, lines: &str) -> String {
    let heading = heading.map_or(String::new(), |heading| {
        format!(
            "<tr class=\"separator\"><th scope=\"rowgroup\" colspan=\"{columns}\"><span>{}</span></th></tr>\n",
            escape(heading)
        )
    });
    format!("<tbody>\n{heading}{lines}</tbody>\n")
}

/// Heading of a column, as HTML, and whether the column holds text or numbers.
pub(super) enum Heading {
    Text(&'static str),
    Number(&'static str),
    /// The number that the rows are about: a phone shows it without scrolling.
    Score(&'static str),
}

/// Header cells whose buttons sort the table.
pub(super) fn sortable(headings: &[Heading]) -> String {
    headings
        .iter()
        .map(|heading| {
            let (class, heading) = match heading {
                Heading::Text(heading) => ("", heading),
                Heading::Number(heading) => (" class=\"number\"", heading),
                Heading::Score(heading) => (" class=\"number score\"", heading),
            };
            format!("<th scope=\"col\"{class} aria-sort=\"none\"><button type=\"button\">{heading}</button></th>")
        })
        .collect()
}

/// A cell that sorts by `value` and shows `shown`.
pub(super) fn number(value: Option<f64>, shown: &str) -> String {
    match value.filter(|value| value.is_finite()) {
        Some(value) => format!("<td class=\"number\" data-value=\"{value}\">{shown}</td>"),
        None => format!("<td class=\"number\">{ABSENT}</td>"),
    }
}

/// - `(steps, published)`: which of these columns there are
fn line(index: usize, set: &DataSet, row: &Scored<'_>, (steps, published): (bool, bool)) -> String {
    let plain = |statistic: &Statistic, scale: f64, decimals: usize| {
        let mean = scale * statistic.mean;
        number(Some(mean), &decimal(mean, decimals))
    };
    let accuracy = |statistic: Option<&Statistic>| {
        number(
            statistic.map(|s| s.mean),
            &statistic.map(percent_and_sd).unwrap_or_default(),
        )
    };
    let mut cells = format!(
        "<th scope=\"row\"><a href=\"#row-{index}\">{}</a></th>",
        escape(&set.name(row)),
    );
    let seconds = row.train_seconds.mean;
    cells.push_str(&accuracy(Some(row.one_sweep)));
    cells.push_str(&number(
        row.one_sweep.ci95.map(|ci| ci[0]),
        &percent_interval(row.one_sweep),
    ));
    cells.push_str(&accuracy(row.three_sweeps));
    cells.push_str(&accuracy(row.three_votes));
    cells.push_str(&number(Some(row.sigma_test), &percent(row.sigma_test)));
    cells.push_str(&plain(row.negative_log_likelihood, 1.0, 3));
    cells.push_str(&plain(row.expected_calibration_error, 100.0, 1));
    cells.push_str(&plain(row.brier, 1.0, 3));
    cells.push_str(&plain(
        row.train_seconds,
        1.0,
        if seconds < 100.0 { 1 } else { 0 },
    ));
    cells.push_str(&number(
        Some(row.folds.len() as f64),
        &row.folds.len().to_string(),
    ));
    if steps {
        cells.push_str(&number(Some(row.steps as f64), &row.steps.to_string()));
    }
    if published {
        for value in [
            row.published.map(|p| p.one_sweep),
            row.published.map(|p| p.three_sweeps),
        ] {
            cells.push_str(&number(
                value,
                &value.map(|v| decimal(v, 1)).unwrap_or_default(),
            ));
        }
    }
    format!("<tr>{cells}</tr>\n")
}
