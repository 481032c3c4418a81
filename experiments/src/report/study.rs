//! What a study found: tables, curves, comparisons, and the tasks behind them.

mod comparisons;
mod curves;
mod maps;
mod tasks;
mod terms;

use super::results::Heading::{Number, Text};
use super::results::{number, sortable};
use super::text::{ABSENT, decimal, escape, percent, scroll};
use crate::{Study, StudySummary};

/// Sections of the page: identifier, heading, content.
pub(super) fn sections(study: &StudySummary) -> Vec<(&'static str, &'static str, String)> {
    let mut sections = vec![("results", "Results", results(study))];
    sections.push(("curves", "At a glance", curves::curves(study)));
    if !study.maps.is_empty() {
        let maps: String = study.maps.iter().map(maps::map).collect();
        sections.push((
            "maps",
            "Feature maps",
            format!("<div class=\"panels\">\n{maps}</div>\n"),
        ));
    }
    if !study.comparisons.is_empty() {
        sections.push((
            "comparisons",
            "Paired comparisons",
            comparisons::comparisons(study),
        ));
    }
    if study.kind == Study::Nshot {
        sections.push(("efficiency", "Sweeps saved", comparisons::efficiency(study)));
    }
    sections.push(("tasks", "Where the numbers come from", tasks::tasks(study)));
    sections.push(("glossary", "How to read this", terms::terms(study.kind)));
    sections
}

/// Whether a measure is a share, which is shown in percent.
fn is_share(measure: &str) -> bool {
    !matches!(measure, "set size" | "mean sweeps")
}

fn shown(measure: &str, value: f64) -> String {
    if is_share(measure) {
        percent(value)
    } else {
        decimal(value, 2)
    }
}

fn count(value: Option<usize>) -> String {
    number(
        value.map(|value| value as f64),
        &value.map(|value| value.to_string()).unwrap_or_default(),
    )
}

fn interval(measure: &str, low: Option<f64>, high: Option<f64>) -> String {
    match (low, high) {
        (Some(low), Some(high)) => format!("[{}, {}]", shown(measure, low), shown(measure, high)),
        _ => ABSENT.to_string(),
    }
}

fn results(study: &StudySummary) -> String {
    if study.rows.is_empty() {
        return "<p>No task has ended yet.</p>\n".to_string();
    }
    let lines: String = study
        .rows
        .iter()
        .map(|row| {
            let published = |value: Option<f64>| {
                number(value, &value.map(|value| shown(&row.measure, value)).unwrap_or_default())
            };
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><th scope=\"row\">{}</th><td>{}</td>{}{}{}{}{}{}{}</tr>\n",
                escape(&row.data),
                escape(&row.levels),
                escape(&row.model),
                escape(&row.measure),
                escape(&row.method),
                escape(&row.setting),
                count(row.shots),
                count(row.sweeps),
                number(Some(row.mean), &shown(&row.measure, row.mean)),
                number(row.ci95_low, &interval(&row.measure, row.ci95_low, row.ci95_high)),
                number(Some(row.n as f64), &row.n.to_string()),
                published(row.published),
                published(row.humans),
            )
        })
        .collect();
    let table = format!(
        "<table class=\"sortable results\">\n<caption class=\"hidden\">What was measured</caption>\n<thead><tr>{}</tr></thead>\n\
         <tbody>\n{lines}</tbody>\n</table>\n",
        sortable(&[
            Text("Data"),
            Text("Levels"),
            Text("Networks"),
            Text("Measure"),
            Text("Method"),
            Text("Setting"),
            Number("Shots"),
            Number("Sweeps"),
            Number("Mean<br><small>%, or a number</small>"),
            Number("95 % interval"),
            Number("Tasks"),
            Number("Published<br><small>TactMat</small>"),
            Number("Humans<br><small>published</small>"),
        ])
    );
    format!(
        "<p>Means over tasks. Shares are in percent; set sizes and numbers of sweeps are numbers.</p>\n{}",
        scroll("Results table", &table)
    )
}
