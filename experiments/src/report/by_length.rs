//! The section on accuracy as a function of the length of sweeps.

use maud::{Markup, html};
use tactnet_pipeline::LengthAccuracy;

use super::data_set::DataSet;
use super::table::{Heading, plain};
use super::text::{percent, scroll};
use crate::scored::Scored;

/// Returns a table for each data set of unequal lengths; `None` without one.
pub(super) fn section(sets: &[DataSet]) -> Option<Markup> {
    let is_unequal = |set: &&DataSet| set.contenders().into_iter().any(is_of_lengths);
    sets.iter().find(is_unequal)?;
    Some(html! {
        p {
            "Accuracy of single sweeps by length, in %. The sweeps of each fold are divided into quartiles of length; a range "
            "is that of all folds. In brackets: 95\u{a0}% interval of the sampling error of the sweeps."
        }
        @for set in sets.iter().filter(is_unequal) {
            @for row in set.contenders().into_iter().filter(|row| is_of_lengths(row)) { (table(set, row)) }
        }
    })
}

/// Returns true if the sweeps differ in length.
fn is_of_lengths(row: &Scored<'_>) -> bool {
    !row.by_length.is_empty()
}

fn table(set: &DataSet, row: &Scored<'_>) -> Markup {
    let name = format!("{}: {}", set.heading(), set.name(row));
    let headings = [
        Heading::text("Steps"),
        Heading::number("Sweeps", ""),
        Heading::score("1 sweep", "%"),
    ];
    let rows = html! { @for group in &row.by_length { (line(group)) } };
    html! {
        h3 { (name) }
        (scroll(&format!("Accuracy by length of {name}"), &plain(&html! {}, &headings, &rows)))
    }
}

fn line(group: &LengthAccuracy) -> Markup {
    let of = group.accuracy;
    html! {
        tr {
            th scope="row" { (group.shortest) " to " (group.longest) }
            td.number { (of.n) }
            td.number { (percent(of.mean)) " (" (percent(of.ci95_low)) " to " (percent(of.ci95_high)) ")" }
        }
    }
}
