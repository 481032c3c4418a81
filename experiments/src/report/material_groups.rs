//! Materials that are confused with each other.

use tactnet_plot::escape;

use super::data_set::DataSet;
use super::text::{decimal, percent, scroll};
use crate::questions::Scored;
use crate::{Grouping, Summary};

pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> String {
    let mut html = "<p>Spectral clustering of the confusion matrix: materials in one group are confused with each other more than \
                    with the rest. Accuracy of groups is the share of sweeps whose predicted material lies in the true one's \
                    group. Published for TactMat: 94.7\u{a0}% with one sweep on six groups; humans 52.6\u{a0}%, on groups that each \
                    subject formed for themselves.</p>\n"
        .to_string();
    let before = html.len();
    for set in sets {
        let best = set.best().map(|row| row.key);
        for row in &set.rows {
            if let Some(grouping) = summary.groups.get(row.key) {
                html.push_str(&groups(set, row, grouping, best == Some(row.key)));
            }
        }
    }
    if html.len() == before {
        html.push_str("<p>No groups were formed here.</p>\n");
    }
    html
}

fn groups(set: &DataSet, row: &Scored<'_>, grouping: &Grouping, open: bool) -> String {
    let name = format!("{}: {}", set.heading(), set.name(row));
    let count = grouping.group_of.iter().max().map_or(0, |last| last + 1);
    let lines: String = (0..count)
        .map(|group| {
            let members: Vec<String> = row
                .materials
                .iter()
                .zip(&grouping.group_of)
                .filter(|(_, of)| **of == group)
                .map(|(material, _)| escape(material))
                .collect();
            format!(
                "<tr><th scope=\"row\" class=\"number\">{}</th><td class=\"number\">{}</td><td class=\"prose\">{}</td></tr>\n",
                group + 1,
                members.len(),
                members.join(", ")
            )
        })
        .collect();
    let table = format!(
        "<table>\n<thead><tr><th scope=\"col\">Group</th><th scope=\"col\" class=\"number\">Materials</th>\
         <th scope=\"col\">Names</th></tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n"
    );
    let stability = match grouping.stability {
        Some(index) => format!(
            "Stability: {}, the mean adjusted Rand index against groupings of resampled matrices (1: always the same, 0: chance).",
            decimal(index, 2)
        ),
        None => "Stability is not known.".to_string(),
    };
    let consecutive = if grouping.consecutive {
        "Every group is consecutive in label order."
    } else {
        "Not every group is consecutive in label order."
    };
    format!(
        "<details{}><summary>{}: {count} groups, {}\u{a0}%</summary>\n<p>{stability} {consecutive}</p>\n{}</details>\n",
        if open { " open" } else { "" },
        escape(&name),
        percent(grouping.accuracy),
        scroll(&format!("Groups of {name}"), &table)
    )
}
