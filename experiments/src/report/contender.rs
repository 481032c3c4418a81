//! The most accurate model of each data set in detail.

use maud::{Markup, html};

use super::calibration::{reliability, risk_coverage};
use super::confusion::{Cells, Confusion, shades};
use super::data_set::{DataSet, split_name};
use super::text::{percent, percent_and_sd, scroll};
use crate::Summary;
use crate::phrases::listed;
use crate::scored::Scored;

/// Returns the best model of each data set; `None` without a finished model.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<Markup> {
    let mut best = sets
        .iter()
        .filter_map(|set| Some((set, set.best()?)))
        .peekable();
    best.peek()?;
    Some(html! {
        p {
            "For each data set, the model with the highest accuracy of single sweeps; the first of the table if several are "
            "equal. The selection by this number makes it slightly optimistic."
        }
        @for (set, best) in best { (contender(summary, set, best)) }
    })
}

fn contender(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> Markup {
    let size = best.materials.len();
    let square = size > 0
        && best.confusion.len() == size
        && best.confusion.iter().all(|row| row.len() == size);
    html! {
        h3 { (set.heading()) ": " (set.name(best)) }
        p {
            "One sweep: " (percent_and_sd(best.one_sweep)) "\u{a0}%"
            @if let Some(three) = best.three_sweeps { ", three fused: " (percent(three.mean)) "\u{a0}%" }
            ". Test sweeps: " (split_name(&best.split))
            @if best.folds.len() > 1 { ", counted together" }
            "."
            @match set.tied().as_slice() {
                [] => {}
                [one] => { " " (one) " is as accurate." }
                others => { " " (listed(others)) " are as accurate." }
            }
        }
        @if square { (matrix(summary, set, best)) }
        div.columns { (reliability(set)) (risk_coverage(set)) }
    }
}

fn matrix(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> Markup {
    let title = format!(
        "Confusion matrix of {} on {}",
        set.name(best),
        set.heading()
    );
    let label = format!("Most frequent confusions: {title}");
    let names = best.materials.iter().map(String::as_str).collect();
    let mut confusion = Confusion::new(title, names, Cells::Counts(best.confusion.clone()));
    let mut order = "Materials in label order.";
    if let Some(grouping) = summary.groups.get(&best.key) {
        confusion = confusion.grouped(grouping);
        order = "Materials ordered by group; frames mark the groups.";
    }
    html! {
        figure {
            (confusion.detailed())
            (shades())
            figcaption {
                "Rows: true material; columns: predicted. Colour: share of the true material's sweeps (shades as in the key). "
                (order) " Point at a cell, or focus the matrix and use the arrow keys. Right: accuracy of each material."
            }
        }
        (scroll(&label, &confusion.most_frequent(8)))
    }
}
