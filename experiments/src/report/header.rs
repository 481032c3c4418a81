//! What was run, where and from which data.

use std::collections::BTreeSet;

use tactnet_plot::escape;

use super::text::{commits, duration, hash};
use crate::Summary;

pub(super) fn header(summary: &Summary) -> String {
    let mut html = format!(
        "<p class=\"overline\">{}</p>\n<h1>{}</h1>\n",
        escape(&summary.name),
        escape(&summary.title)
    );
    if summary.tasks_done < summary.tasks {
        html.push_str(&format!(
            "<p class=\"warning\"><strong>Unfinished:</strong> {} of {} tasks are done. Every number below comes from \
             those alone and will change.</p>\n",
            summary.tasks_done, summary.tasks
        ));
    }
    for name in twins(summary) {
        html.push_str(&format!(
            "<p class=\"note\">The sweeps of <code>{}</code> are synthetic: a generator made them, and the numbers on \
             them are not TactMat's.</p>\n",
            escape(name)
        ));
    }
    let data: String = summary
        .data
        .iter()
        .map(|(name, data)| format!("<li>{} {}</li>", escape(name), hash(&data.sha256)))
        .collect();
    let facts = [
        ("Expected", escape(&summary.expects)),
        (
            "Command",
            format!("<code>{}</code>", escape(&summary.command)),
        ),
        ("Commit", commits(&summary.git)),
        ("Seed", summary.seed.to_string()),
        ("Processor", escape(&summary.processors.join("; "))),
        (
            "Tasks",
            format!("{} of {} done", summary.tasks_done, summary.tasks),
        ),
        (
            "Training time",
            format!("{}, all tasks together", duration(summary.train_seconds)),
        ),
        (
            "Data, SHA-256",
            if data.is_empty() {
                data
            } else {
                format!("<ul>{data}</ul>")
            },
        ),
    ];
    html.push_str("<dl class=\"facts\">\n");
    for (term, fact) in facts.iter().filter(|(_, fact)| !fact.is_empty()) {
        html.push_str(&format!("<div><dt>{term}</dt><dd>{fact}</dd></div>\n"));
    }
    html.push_str("</dl>\n");
    html
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
