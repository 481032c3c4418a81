//! What a study found: tables, curves, comparisons, and the tasks behind them.

mod comparisons;
mod curves;
mod maps;
mod tasks;

use tactnet_plot::escape;

use super::results::Heading::{Number, Text};
use super::results::{number, sortable};
use super::terms::terms;
use super::text::{ABSENT, decimal, percent, scroll};
use crate::{Measure, Summary};

/// Words of every page.
const TERMS: [(&str, &str); 2] = [
    (
        "95 % interval",
        "Of the mean over tasks. Where tasks share training sweeps it is widened for that (Nadeau and Bengio, 2003). Draws of new materials all come from one data set: their interval says nothing about other data sets.",
    ),
    (
        "Shots",
        "Sweeps of every new material that are learnt from.",
    ),
];

/// Sections of the page: identifier, heading, content.
pub(super) fn sections(summary: &Summary) -> Vec<(&'static str, &'static str, String)> {
    let mut sections = vec![("results", "Results", results(summary))];
    sections.push(("curves", "At a glance", curves::curves(summary)));
    if !summary.maps.is_empty() {
        let maps: String = summary.maps.iter().map(maps::map).collect();
        sections.push((
            "maps",
            "Feature maps",
            format!("<div class=\"panels\">\n{maps}</div>\n"),
        ));
    }
    if !summary.comparisons.is_empty() {
        sections.push((
            "comparisons",
            "Paired comparisons",
            comparisons::comparisons(summary),
        ));
    }
    if let Some(efficiency) = &summary.sample_efficiency {
        sections.push((
            "efficiency",
            "Sweeps saved",
            comparisons::efficiency(efficiency),
        ));
    }
    sections.push((
        "tasks",
        "Where the numbers come from",
        tasks::tasks(&summary.records),
    ));
    let words = [&TERMS, summary.question.ask().terms()].concat();
    sections.push(("glossary", "How to read this", terms(&words)));
    sections
}

fn shown(measure: Measure, value: f64) -> String {
    if measure.unit().in_percent() {
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

fn interval(measure: Measure, ci95: Option<[f64; 2]>) -> String {
    match ci95 {
        Some([low, high]) => format!("[{}, {}]", shown(measure, low), shown(measure, high)),
        _ => ABSENT.to_string(),
    }
}

fn results(study: &Summary) -> String {
    if study.rows.is_empty() {
        return "<p>No task has ended yet.</p>\n".to_string();
    }
    let lines: String = study
        .rows
        .iter()
        .map(|row| {
            let published = |value: Option<f64>| {
                number(value, &value.map(|value| shown(row.measure, value)).unwrap_or_default())
            };
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><th scope=\"row\">{}</th><td>{}</td>{}{}{}{}{}{}{}</tr>\n",
                escape(&row.data),
                escape(row.levels.name()),
                escape(&row.model),
                escape(row.measure.name()),
                escape(&row.method),
                escape(&row.setting),
                count(row.shots),
                count(row.sweeps),
                number(Some(row.statistic.mean), &shown(row.measure, row.statistic.mean)),
                number(row.statistic.ci95.map(|ends| ends[0]), &interval(row.measure, row.statistic.ci95)),
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
