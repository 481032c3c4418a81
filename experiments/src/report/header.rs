//! Title, headline, and what must be known before the numbers.

use std::collections::BTreeSet;

use tactnet_plot::escape;

use crate::Summary;

/// - `headline`: HTML, the first text after the title
pub(super) fn header(summary: &Summary, headline: &str) -> String {
    let twins: String = twins(summary)
        .into_iter()
        .map(|name| {
            format!(
                "<p class=\"note\">The sweeps of <code>{}</code> are synthetic: a generator made them, and the numbers on \
                 them are not TactMat's.</p>\n",
                escape(name)
            )
        })
        .collect();
    format!(
        "<p class=\"overline\">{}</p>\n<h1>{}</h1>\n{headline}{twins}",
        escape(&summary.name),
        escape(&summary.title)
    )
}

/// Names of the synthetic data sets.
fn twins(summary: &Summary) -> BTreeSet<&str> {
    let rows = summary.rows.iter();
    let of_rows = rows.map(|row| (row.data.as_str(), row.origin));
    let data = summary.data.iter();
    let of_data = data.map(|(name, data)| (name.as_str(), data.origin));
    of_rows
        .chain(of_data)
        .filter(|(_, origin)| origin.is_synthetic())
        .map(|(name, _)| name)
        .collect()
}
