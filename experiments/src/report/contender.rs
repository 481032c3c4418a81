//! The most accurate model of each data set, looked at closely.

use tactnet_plot::escape;

use super::calibration::{reliability, risk_coverage};
use super::confusion::{Cells, Confusion, shades};
use super::data_set::{DataSet, split_name};
use super::text::{percent, percent_and_sd, scroll};
use crate::Summary;
use crate::questions::{Scored, listed};

/// Returns the best model of each data set; `None` before one has ended.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<String> {
    let parts: String = sets
        .iter()
        .filter_map(|set| set.best().map(|best| contender(summary, set, best)))
        .collect();
    (!parts.is_empty()).then(|| {
        format!(
            "<p>For each data set, the model with the highest accuracy of single sweeps; of models that tie, the first of the table. It was chosen by that number, so the number \
             flatters it a little.</p>\n{parts}"
        )
    })
}

fn contender(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> String {
    let name = set.name(best);
    let three = best
        .three_sweeps
        .map(|three| format!(", three fused: {}\u{a0}%", percent(three.mean)))
        .unwrap_or_default();
    let together = match best.folds.len() {
        1 => "",
        _ => ", counted together",
    };
    let tied = match set.tied().as_slice() {
        [] => String::new(),
        [one] => format!(" {} is as accurate.", escape(one)),
        others => format!(" {} are as accurate.", escape(&listed(others))),
    };
    let mut html = format!(
        "<h3>{}: {}</h3>\n<p>One sweep: {}\u{a0}%{three}. Test sweeps: {}{together}.{tied}</p>\n",
        escape(&set.heading()),
        escape(&name),
        percent_and_sd(best.one_sweep),
        escape(&split_name(best.split)),
    );
    let size = best.materials.len();
    if size > 0
        && best.confusion.len() == size
        && best.confusion.iter().all(|row| row.len() == size)
    {
        html.push_str(&matrix(summary, set, best));
    }
    html.push_str(&format!(
        "<div class=\"columns\">\n{}{}</div>\n",
        reliability(set),
        risk_coverage(set)
    ));
    html
}

fn matrix(summary: &Summary, set: &DataSet, best: &Scored<'_>) -> String {
    let title = format!(
        "Confusion matrix of {} on {}",
        set.name(best),
        set.heading()
    );
    let names = best.materials.iter().map(String::as_str).collect();
    let mut confusion =
        Confusion::new(title.clone(), names, Cells::Counts(best.confusion.to_vec()));
    let mut order = "Materials in label order.";
    if let Some(grouping) = summary.groups.get(best.key) {
        confusion = confusion.grouped(grouping);
        order = "Materials ordered by group; frames mark the groups.";
    }
    format!(
        "<figure>\n{}{}<figcaption>Rows: true material; columns: predicted. Colour: share of the true material's sweeps (shades as in the key). {order} Point at a cell, or focus the matrix and use the arrow keys. Right: accuracy of each \
         material.</figcaption>\n</figure>\n{}",
        confusion.detailed(),
        shades(),
        scroll(
            &format!("Most frequent confusions: {title}"),
            &confusion.most_frequent(8)
        )
    )
}
