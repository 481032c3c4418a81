//! The sections of a study: tables, figures, comparisons and provenance.

mod comparisons;
mod curves;
mod maps;
mod strengths;
mod tasks;

use maud::{Markup, html};

use super::provenance;
use super::table::{Heading, body, count, number, sortable};
use super::terms::terms;
use super::text::{ABSENT, decimal, notes, percent};
use super::{PROVENANCE, Section};
use crate::interval_note::interval_notes;
use crate::measure::method_name;
use crate::{Measure, Row, Summary, Unit};

/// Glossary of all studies.
const TERMS: [(&str, &str); 2] = [
    (
        "95 % interval",
        "Interval of the mean over tasks, corrected for training sweeps that tasks share (Nadeau and Bengio, 2003). All draws of new materials come from one data set, so their interval does not extend to other data sets.",
    ),
    ("Shots", "Support sweeps of each new material."),
];

/// Returns the sections of the page.
pub(super) fn sections(summary: &Summary) -> Vec<Section> {
    let any_maps = !summary.maps.is_empty();
    let maps =
        any_maps.then(|| html! { div.panels { @for map in &summary.maps { (maps::map(map)) } } });
    let compared = !summary.comparisons.is_empty();
    let saved = summary
        .sample_efficiency
        .as_deref()
        .filter(|saved| !saved.is_empty());
    let provenance = html! { (provenance::run(summary)) (tasks::tasks(&summary.records)) };
    let words = [&TERMS, summary.question.ask().terms()].concat();
    vec![
        Section::new("results", "Results", results(summary)),
        Section::new("curves", "At a glance", curves::curves(summary)),
        Section::new("maps", "Feature maps", maps),
        Section::new(
            "comparisons",
            "Paired comparisons",
            compared.then(|| comparisons::comparisons(summary)),
        ),
        Section::new(
            "efficiency",
            "Sweeps saved",
            saved.map(comparisons::efficiency),
        ),
        Section::new("provenance", PROVENANCE, Some(provenance)),
        Section::new("glossary", "How to read this", Some(terms(&words))),
    ]
}

fn shown(measure: Measure, value: f64) -> String {
    if measure.unit().in_percent() {
        percent(value)
    } else {
        decimal(value, 2)
    }
}

fn interval(measure: Measure, ci95: Option<[f64; 2]>) -> String {
    match ci95 {
        Some([low, high]) => format!("[{}, {}]", shown(measure, low), shown(measure, high)),
        _ => ABSENT.to_string(),
    }
}

/// Common properties of the rows of one part of the table: data set, levels, networks and measure.
type Part<'a> = (&'a str, &'a str, &'a str, Measure);

fn part_of(row: &Row) -> Part<'_> {
    (&row.data, row.levels.name(), &row.model, row.measure)
}

/// Optional columns, shown if any row has a value.
#[derive(Clone, Copy)]
struct Columns {
    setting: bool,
    shots: bool,
    sweeps: bool,
    published: bool,
    humans: bool,
}

impl Columns {
    fn of(rows: &[Row]) -> Self {
        let any = |has: &dyn Fn(&Row) -> bool| rows.iter().any(has);
        Self {
            setting: any(&|row| !row.setting.is_empty()),
            shots: any(&|row| row.shots.is_some()),
            sweeps: any(&|row| row.sweeps.is_some()),
            published: any(&|row| row.published.is_some()),
            humans: any(&|row| row.humans.is_some()),
        }
    }

    fn headings(self) -> Vec<Heading> {
        let all = [
            (true, Heading::text("Method")),
            (self.setting, Heading::text("Setting")),
            (self.shots, Heading::number("Shots", "")),
            (self.sweeps, Heading::number("Sweeps", "")),
            (true, Heading::score("Mean", "")),
            (true, Heading::number("95 % interval", "")),
            (self.published, Heading::number("Published", "TactMat")),
            (self.humans, Heading::number("Humans", "published")),
            (true, Heading::number("Tasks", "")),
        ];
        all.into_iter()
            .filter(|(shown, _)| *shown)
            .map(|(_, heading)| heading)
            .collect()
    }

    fn line(self, row: &Row) -> Markup {
        let value = |value: Option<f64>| {
            let shown = value
                .map(|value| shown(row.measure, value))
                .unwrap_or_default();
            number(value, &shown)
        };
        let ci95 = row.statistic.ci95;
        html! {
            tr {
                th scope="row" { (method_name(&row.method)) }
                @if self.setting { td.wraps { (row.setting) } }
                @if self.shots { (count(row.shots)) }
                @if self.sweeps { (count(row.sweeps)) }
                (value(Some(row.statistic.mean)))
                (number(ci95.map(|ends| ends[0]), &interval(row.measure, ci95)))
                @if self.published { (value(row.published)) }
                @if self.humans { (value(row.humans)) }
                (count(Some(row.n)))
            }
        }
    }
}

/// Returns the unit of a measure, as shown above its numbers.
fn unit(measure: Measure) -> &'static str {
    match measure.unit() {
        Unit::Share | Unit::ShareDifference => "%",
        Unit::Nats => "nats",
        Unit::Seconds => "s",
        Unit::Squared => "0 to 2",
        Unit::Materials => "materials",
        Unit::Sweeps => "sweeps",
        Unit::Operations => "millions",
    }
}

fn results(study: &Summary) -> Option<Markup> {
    let mut parts: Vec<Part> = Vec::new();
    for part in study.rows.iter().map(part_of) {
        if !parts.contains(&part) {
            parts.push(part);
        }
    }
    let (data, levels, networks, _) = *parts.first()?;
    let one_set = parts
        .iter()
        .all(|part| (part.0, part.1, part.2) == (data, levels, networks));
    let heading = |(data, levels, networks, measure): Part<'_>| match one_set {
        true => format!("{measure}, {}", unit(measure)),
        false => format!(
            "{data}, levels {levels}, networks by {networks}: {measure}, {}",
            unit(measure)
        ),
    };
    let columns = Columns::of(&study.rows);
    let headings = columns.headings();
    let bodies = html! {
        @for part in parts {
            @let rows = html! {
                @for row in study.rows.iter().filter(|row| part_of(row) == part) { (columns.line(row)) }
            };
            (body(Some(&heading(part)), headings.len(), &rows))
        }
    };
    let named = study.rows.iter().map(|row| {
        (
            format!("{} of {}", row.measure, method_name(&row.method)),
            &row.statistic,
        )
    });
    Some(html! {
        p {
            @if one_set { "All rows: " (data) ", levels " (levels) ", networks by " (networks) ". " }
            "Means over tasks."
        }
        (sortable("Results table", "results", "Measurements", &headings, &bodies))
        (notes(&interval_notes(named, "task")))
    })
}
