//! Pairs of rows on the same folds.

use tactnet_plot::escape;

use super::data_set::DataSet;
use super::results::Heading::{Number, Text};
use super::results::{number, sortable};
use super::text::{decimal, p_value, scroll};
use crate::Summary;

/// Returns the table; `None` if no two rows share folds.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<String> {
    if summary.comparisons.is_empty() {
        return None;
    }
    let name = |key: &str| -> String {
        sets.iter()
            .find_map(|set| {
                let contender = &summary.row(key)?.contender;
                let row = set.rows.iter().find(|row| row.key == contender)?;
                Some(format!("{}: {}", set.heading(), set.name(row)))
            })
            .unwrap_or_else(|| key.to_string())
    };
    let lines: String = summary
        .comparisons
        .iter()
        .map(|comparison| {
            let points = 100.0 * comparison.difference;
            format!(
                "<tr><td>{}</td><td>{}</td>{}{}{}</tr>\n",
                escape(&name(&comparison.first)),
                escape(&name(&comparison.second)),
                number(Some(points), &decimal(points, 1)),
                number(comparison.p, &comparison.p.map(p_value).unwrap_or_default()),
                number(Some(comparison.n as f64), &comparison.n.to_string())
            )
        })
        .collect();
    let table = format!(
        "<table class=\"sortable\">\n<caption class=\"hidden\">Differences of accuracy on the same folds</caption>\n\
         <thead><tr>{}</tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n",
        sortable(&[
            Text("First"),
            Text("Second"),
            Number("First \u{2212} second<br><small>points</small>"),
            Number("p"),
            Number("Folds"),
        ])
    );
    Some(format!(
        "<p>Difference of single-sweep accuracy, in percentage points, on the folds that both have. p is from the corrected \
         resampled t-test (Nadeau and Bengio, 2003), two-sided, and is not adjusted for the number of comparisons.</p>\n{}",
        scroll("Paired comparisons", &table)
    ))
}
