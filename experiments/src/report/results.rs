//! The table of results: one row for each model, grouped by data set.

use maud::{Markup, html};

use super::data_set::{DataSet, split_name};
use super::table::{Heading, body, count, number, sortable};
use super::text::{decimal, notes, percent, percent_and_sd, percent_interval};
use crate::Statistic;
use crate::interval_note::interval_notes;
use crate::scored::{FewSteps, Scored, few_steps};

/// Optional columns of the table.
#[derive(Clone, Copy)]
struct Columns {
    balanced: bool,
    steps: bool,
    published: bool,
}

/// Returns the table; `None` without results. A sentence replaces columns that would be equal in all rows.
pub(super) fn section(contenders: &[Scored<'_>], sets: &[DataSet]) -> Option<Markup> {
    let first = contenders.first()?;
    let columns = Columns {
        balanced: contenders.iter().any(Scored::is_unbalanced),
        steps: contenders.iter().any(|row| row.steps != first.steps),
        published: contenders.iter().any(|row| row.published.is_some()),
    };
    let headings = headings(columns);
    let parts = sets
        .iter()
        .flat_map(|set| [(set, set.contenders(), false), (set, set.probes(), true)]);
    let bodies = html! {
        @for (set, rows, probes) in parts.filter(|(_, rows, _)| !rows.is_empty()) {
            @let rows = html! { @for row in rows { (line(contenders, set, row, columns)) } };
            (body(part_heading(sets.len(), set, probes).as_deref(), headings.len(), &rows))
        }
    };
    let caption = "Accuracy and calibration of every model";
    Some(html! {
        p {
            (common(contenders, sets)) @if columns.balanced { " Balanced: the mean of the materials' recalls." } " Means over folds, most accurate first. Intervals are corrected for training sweeps that "
            "folds share (Nadeau and Bengio, 2003). For NLL, ECE and Brier, smaller is better. A model's name links to its folds."
        }
        (sortable("Results table", "results", caption, &headings, &bodies))
        (notes(&interval_notes(contenders.iter().map(|row| (row.name(), row.one_sweep)), "fold")))
        (notes(&few_steps(contenders).iter().map(few_steps_text).collect::<Vec<_>>()))
    })
}

fn headings(columns: Columns) -> Vec<Heading> {
    let mut headings = vec![
        Heading::text("Model"),
        Heading::score("1 sweep", "% (sd)"),
        Heading::number("95 % interval", "1 sweep, %"),
    ];
    if columns.balanced {
        headings.push(Heading::number("Balanced", "1 sweep, % (sd)"));
        headings.push(Heading::number("95 % interval", "balanced, %"));
    }
    headings.extend([
        Heading::number("3 sweeps", "% (sd)"),
        Heading::number("3 sweeps, vote", "% (sd)"),
        Heading::number("\u{3c3}<sub>test</sub>", "%"),
        Heading::number("NLL", "nats"),
        Heading::number("ECE", "%"),
        Heading::number("Brier", "0 to 2"),
        Heading::number("Training", "s/fold"),
        Heading::number("Folds", ""),
    ]);
    if columns.steps {
        headings.push(Heading::number("Steps", ""));
    }
    if columns.published {
        headings.push(Heading::number("1 sweep, %", "published, TactMat"));
        headings.push(Heading::number("3 sweeps, %", "published, TactMat"));
    }
    headings
}

/// Returns the heading over the contenders or the probes of a data set; `None` if it is not needed.
fn part_heading(sets: usize, set: &DataSet, probes: bool) -> Option<String> {
    match (probes, sets) {
        (false, 1) => None,
        (false, _) => Some(set.heading()),
        (true, 1) => Some("Probes: information other than texture, not contenders".into()),
        (true, _) => Some(format!("Probes on {}", set.heading())),
    }
}

fn few_steps_text(few: &FewSteps) -> String {
    let (steps, epochs) = (few.steps, few.steps.epochs_for_enough());
    format!(
        "{} on {}: {} training steps are few; `epochs = {epochs}` trains for {}",
        few.model,
        few.data,
        steps.count(),
        epochs * steps.batches
    )
}

/// Returns the common properties of all rows as a sentence.
fn common(contenders: &[Scored<'_>], sets: &[DataSet]) -> String {
    let mut common = Vec::new();
    if let [set] = sets {
        common.push(set.heading());
    }
    if let [first, rest @ ..] = contenders {
        if rest.iter().all(|row| row.split == first.split) {
            common.push(split_name(&first.split));
        }
        if rest.iter().all(|row| row.steps == first.steps) {
            common.push(format!("{} time steps", first.steps));
        }
    }
    if common.is_empty() {
        String::new()
    } else {
        format!("All rows: {}.", common.join(", "))
    }
}

fn line(contenders: &[Scored<'_>], set: &DataSet, row: &Scored<'_>, columns: Columns) -> Markup {
    // The position in the summary identifies the row's folds.
    let index = contenders.iter().position(|other| other.key == row.key);
    let plain = |statistic: &Statistic, scale: f64, decimals: usize| {
        let mean = scale * statistic.mean;
        number(Some(mean), &decimal(mean, decimals))
    };
    let accuracy = |statistic: Option<&Statistic>| {
        let shown = statistic.map(percent_and_sd).unwrap_or_default();
        number(statistic.map(|statistic| statistic.mean), &shown)
    };
    let published = row.published.as_ref();
    let published = [
        published.map(|of| of.one_sweep),
        published.map(|of| of.three_sweeps),
    ];
    html! {
        tr {
            th scope="row" { a href={ "#row-" (index.unwrap_or_default()) } { (set.name(row)) } }
            (accuracy(Some(row.one_sweep)))
            (number(row.one_sweep.ci95.map(|ends| ends[0]), &percent_interval(row.one_sweep)))
            @if columns.balanced {
                (accuracy(row.balanced))
                (number(row.balanced.and_then(|of| of.ci95).map(|ends| ends[0]), &row.balanced.map(percent_interval).unwrap_or_default()))
            }
            (accuracy(row.three_sweeps))
            (accuracy(row.three_votes))
            (number(Some(row.sigma_test), &percent(row.sigma_test)))
            (plain(row.negative_log_likelihood, 1.0, 3))
            (plain(row.expected_calibration_error, 100.0, 1))
            (plain(row.brier, 1.0, 3))
            (plain(row.train_seconds, 1.0, usize::from(row.train_seconds.mean < 100.0)))
            (count(Some(row.folds.len())))
            @if columns.steps { (count(Some(row.steps))) }
            @if columns.published {
                @for value in published { (number(value, &value.map(|value| decimal(value, 1)).unwrap_or_default())) }
            }
        }
    }
}
