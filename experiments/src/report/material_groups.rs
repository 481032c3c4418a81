//! Materials that are confused with each other.

use tactnet_plot::escape;

use super::data_set::DataSet;
use super::text::{decimal, percent, scroll};
use crate::published_confusion::TACTMAT_MATERIALS;
use crate::questions::Scored;
use crate::{Grouping, Summary};

const PUBLISHED: &str = " Published for TactMat: 94.7\u{a0}% with one sweep and 98.8\u{a0}% with three on six groups; humans 52.6 and 57.1\u{a0}%, on \
                         groups that each subject formed for themselves.";

/// Returns the groups; `None` if none were formed.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<String> {
    let in_six_groups = |row: &&Scored<'_>| {
        let grouping = summary.groups.get(row.key);
        grouping.is_some_and(|grouping| grouping.group_of.iter().max() == Some(&5))
    };
    let beside_published = sets
        .iter()
        .flat_map(|set| set.rows.iter())
        .filter(|row| in_six_groups(row))
        .any(|row| {
            row.origin.is_comparable_to_published()
                && row.materials.len() == TACTMAT_MATERIALS.len()
        });
    let published = if beside_published { PUBLISHED } else { "" };
    let groups: String = sets
        .iter()
        .flat_map(|set| set.rows.iter().map(move |row| (set, row)))
        .filter_map(|(set, row)| {
            let open = set.best().is_some_and(|best| best.key == row.key);
            Some(groups(set, row, summary.groups.get(row.key)?, open))
        })
        .collect();
    (!groups.is_empty()).then(|| {
        format!(
            "<p>Spectral clustering of the confusion matrix: materials in one group are confused with each other more than \
             with the rest. Accuracy of groups is the share of sweeps whose predicted material lies in the true one's \
             group.{published}</p>\n{groups}"
        )
    })
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
    let of_three = grouping
        .accuracy_of_three
        .map(|share| format!(", {}\u{a0}% with three sweeps", percent(share)))
        .unwrap_or_default();
    format!(
        "<details{}><summary>{}: {count} groups, {}\u{a0}%{of_three}</summary>\n<p>{stability} {consecutive}</p>\n{}</details>\n",
        if open { " open" } else { "" },
        escape(&name),
        percent(grouping.accuracy),
        scroll(&format!("Groups of {name}"), &table)
    )
}
