//! What a study found: tables, curves, comparisons, and the tasks behind them.

mod comparisons;
mod curves;
mod maps;
mod tasks;

use tactnet_plot::escape;

use super::results::Heading::{Number, Score, Text};
use super::results::{body, number, sortable};
use super::terms::terms;
use super::text::{ABSENT, decimal, percent, prose, scroll};
use super::{PROVENANCE, Section, provenance};
use crate::interval_note::interval_notes;
use crate::measure::method_name;
use crate::{Measure, Row, Summary, Unit};

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

/// Sections of the page.
pub(super) fn sections(summary: &Summary) -> Vec<Section> {
    let maps = (!summary.maps.is_empty()).then(|| {
        let maps: String = summary.maps.iter().map(maps::map).collect();
        format!("<div class=\"panels\">\n{maps}</div>\n")
    });
    let compared = !summary.comparisons.is_empty();
    let saved = summary.sample_efficiency.as_deref();
    let saved = saved.filter(|saved| !saved.is_empty());
    let words = [&TERMS, summary.question.ask().terms()].concat();
    vec![
        ("results", "Results", results(summary)),
        ("curves", "At a glance", curves::curves(summary)),
        ("maps", "Feature maps", maps),
        (
            "comparisons",
            "Paired comparisons",
            compared.then(|| comparisons::comparisons(summary)),
        ),
        (
            "efficiency",
            "Sweeps saved",
            saved.map(comparisons::efficiency),
        ),
        (
            "provenance",
            PROVENANCE,
            Some(format!(
                "{}{}",
                provenance::run(summary),
                tasks::tasks(&summary.records)
            )),
        ),
        ("glossary", "How to read this", Some(terms(&words))),
    ]
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

/// What the rows of one part of the table share: data set, levels, networks and measure.
type Part<'a> = (&'a str, &'a str, &'a str, Measure);

fn part_of(row: &Row) -> Part<'_> {
    (&row.data, row.levels.name(), &row.model, row.measure)
}

/// Columns that some row of a study has something for.
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

    fn headings(self) -> Vec<super::results::Heading> {
        let mut headings = vec![Text("Method")];
        for (there, heading) in [
            (self.setting, Text("Setting")),
            (self.shots, Number("Shots")),
            (self.sweeps, Number("Sweeps")),
            (true, Score("Mean")),
            (true, Number("95 % interval")),
            (
                self.published,
                Number("Published<br><small>TactMat</small>"),
            ),
            (self.humans, Number("Humans<br><small>published</small>")),
            (true, Number("Tasks")),
        ] {
            if there {
                headings.push(heading);
            }
        }
        headings
    }

    fn line(self, row: &Row) -> String {
        let published = |value: Option<f64>| {
            number(
                value,
                &value
                    .map(|value| shown(row.measure, value))
                    .unwrap_or_default(),
            )
        };
        let mean = row.statistic.mean;
        let mut cells = format!(
            "<th scope=\"row\">{}</th>",
            escape(method_name(&row.method))
        );
        for (there, cell) in [
            (
                self.setting,
                format!("<td class=\"wraps\">{}</td>", escape(&row.setting)),
            ),
            (self.shots, count(row.shots)),
            (self.sweeps, count(row.sweeps)),
            (true, number(Some(mean), &shown(row.measure, mean))),
            (
                true,
                number(
                    row.statistic.ci95.map(|ends| ends[0]),
                    &interval(row.measure, row.statistic.ci95),
                ),
            ),
            (self.published, published(row.published)),
            (self.humans, published(row.humans)),
            (true, number(Some(row.n as f64), &row.n.to_string())),
        ] {
            if there {
                cells.push_str(&cell);
            }
        }
        format!("<tr>{cells}</tr>\n")
    }
}

/// The unit of a measure as it stands over its numbers.
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

fn results(study: &Summary) -> Option<String> {
    let mut parts: Vec<Part> = Vec::new();
    for part in study.rows.iter().map(part_of) {
        if !parts.contains(&part) {
            parts.push(part);
        }
    }
    let first = *parts.first()?;
    let columns = Columns::of(&study.rows);
    let headings = columns.headings();
    let one_set = parts
        .iter()
        .all(|part| (part.0, part.1, part.2) == (first.0, first.1, first.2));
    let bodies: String = parts
        .iter()
        .map(|part| {
            let own = study.rows.iter().filter(|row| part_of(row) == *part);
            let lines: String = own.map(|row| columns.line(row)).collect();
            let (data, levels, networks, measure) = part;
            let heading = if one_set {
                format!("{measure}, {}", unit(*measure))
            } else {
                format!(
                    "{data}, levels {levels}, networks by {networks}: {measure}, {}",
                    unit(*measure)
                )
            };
            body(Some(&heading), headings.len(), &lines)
        })
        .collect();
    let table = format!(
        "<table class=\"sortable results\">\n<caption class=\"hidden\">What was measured</caption>\n<thead><tr>{}</tr></thead>\n\
         {bodies}</table>\n",
        sortable(&headings)
    );
    let of = if one_set {
        let (data, levels, networks, _) = first;
        format!("All rows: {data}, levels {levels}, networks by {networks}. ")
    } else {
        String::new()
    };
    let rows = study.rows.iter();
    let rows = rows.map(|row| {
        let name = format!("{} of {}", row.measure, method_name(&row.method));
        (name, &row.statistic)
    });
    let notes: String = interval_notes(rows, "task")
        .iter()
        .map(|line| format!("<p class=\"note\">{}</p>\n", prose(line)))
        .collect();
    Some(format!(
        "<p>{}Means over tasks.</p>\n{}{notes}",
        escape(&of),
        scroll("Results table", &table)
    ))
}
