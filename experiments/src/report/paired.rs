//! Pairs of rows on the same folds.

use tactnet_plot::escape;

use super::data_set::DataSet;
use super::results::Heading::{Number, Text};
use super::results::{number, sortable};
use super::text::{decimal, p_value, scroll};
use crate::{Comparison, Summary};

/// Returns the table; `None` if no two rows share folds.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<String> {
    if summary.comparisons.is_empty() {
        return None;
    }
    // The heading of its data set, and its name there.
    let place = |key: &str| -> Option<(String, String)> {
        let contender = &summary.row(key)?.contender;
        sets.iter().find_map(|set| {
            let row = set.rows.iter().find(|row| row.key == contender)?;
            Some((set.heading(), set.name(row)))
        })
    };
    // Two rows that are compared are of one data set.
    let several = sets.len() > 1;
    let name = |key: &str| place(key).map_or_else(|| key.to_string(), |(_, name)| name);
    // What differs most surely stands first.
    let mut comparisons: Vec<_> = summary.comparisons.iter().collect();
    comparisons.sort_by(|one, other| {
        let p = |of: &Comparison| of.p_holm.unwrap_or(f64::INFINITY);
        let by_p = p(one).total_cmp(&p(other));
        by_p.then(other.difference.abs().total_cmp(&one.difference.abs()))
    });
    let lines: String = comparisons
        .into_iter()
        .map(|comparison| {
            let points = 100.0 * comparison.difference;
            let data = place(&comparison.first).map(|(data, _)| data);
            let data = if several {
                format!("<td>{}</td>", escape(&data.unwrap_or_default()))
            } else {
                String::new()
            };
            format!(
                "<tr>{data}<td>{}</td><td>{}</td>{}{}{}{}</tr>\n",
                escape(&name(&comparison.first)),
                escape(&name(&comparison.second)),
                number(Some(points), &decimal(points, 1)),
                number(comparison.p, &comparison.p.map(p_value).unwrap_or_default()),
                number(
                    comparison.p_holm,
                    &comparison.p_holm.map(p_value).unwrap_or_default()
                ),
                number(Some(comparison.n as f64), &comparison.n.to_string())
            )
        })
        .collect();
    let mut headings = vec![
        Text("First"),
        Text("Second"),
        Number("First \u{2212} second<br><small>points</small>"),
        Number("p"),
        Number("p, Holm"),
        Number("Folds"),
    ];
    if several {
        headings.insert(0, Text("Data"));
    }
    let table = format!(
        "<table class=\"sortable\">\n<caption class=\"hidden\">Differences of accuracy on the same folds</caption>\n\
         <thead><tr>{}</tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n",
        sortable(&headings)
    );
    let of = match sets {
        [set] => format!(" All rows: {}.", escape(&set.heading())),
        _ => String::new(),
    };
    Some(format!(
        "<p>Difference of single-sweep accuracy, in percentage points, on the folds that both have. p is from the corrected \
         resampled t-test (Nadeau and Bengio, 2003), two-sided; beside it after Holm's correction for the comparisons on one data set.{of}</p>\n{}",
        scroll("Paired comparisons", &table)
    ))
}
