//! The section on groups of confused materials.

use maud::{Markup, html};

use super::data_set::DataSet;
use super::table::{Heading, plain};
use super::text::{decimal, percent, scroll};
use crate::published_confusion::TACTMAT_MATERIALS;
use crate::scored::Scored;
use crate::{Grouping, Summary};

const PUBLISHED: &str = " Published for TactMat: 94.7\u{a0}% with one sweep and 98.8\u{a0}% with three on six groups; humans 52.6 and \
                         57.1\u{a0}%, on groups that each subject formed.";

/// Returns the groups; `None` if there are none.
pub(super) fn section(summary: &Summary, sets: &[DataSet]) -> Option<Markup> {
    let grouped = || {
        let rows = sets
            .iter()
            .flat_map(|set| set.rows.iter().map(move |row| (set, *row)));
        rows.filter_map(|(set, row)| Some((set, row, summary.groups.get(&row.key)?)))
    };
    grouped().next()?;
    let beside_published = grouped().any(|(_, row, grouping)| {
        grouping.group_of.iter().max() == Some(&5)
            && row.origin.is_comparable_to_published()
            && row.materials.len() == TACTMAT_MATERIALS.len()
    });
    Some(html! {
        p {
            "Spectral clustering of the confusion matrix: materials in a group are confused with each other more than with the "
            "rest. Accuracy of groups is the share of sweeps whose predicted material is in the group of the true one."
            @if beside_published { (PUBLISHED) }
        }
        @for (set, row, grouping) in grouped() { (groups(set, row, grouping)) }
    })
}

fn groups(set: &DataSet, row: &Scored<'_>, grouping: &Grouping) -> Markup {
    let is_best = set.best().is_some_and(|best| best.key == row.key);
    let name = format!("{}: {}", set.heading(), set.name(row));
    let count = grouping.group_of.iter().max().map_or(0, |last| last + 1);
    let members = |group: usize| -> Vec<&str> {
        let materials = row.materials.iter().zip(&grouping.group_of);
        materials
            .filter(|(_, of)| **of == group)
            .map(|(material, _)| material.as_str())
            .collect()
    };
    let rows = html! {
        @for (group, members) in (0..count).map(|group| (group, members(group))) {
            tr {
                th.number scope="row" { (group + 1) }
                td.number { (members.len()) }
                td.prose { (members.join(", ")) }
            }
        }
    };
    let headings = [
        Heading::text("Group"),
        Heading::number("Materials", ""),
        Heading::text("Names"),
    ];
    html! {
        details open[is_best] {
            summary {
                (name) ": " (count) " groups, " (percent(grouping.accuracy)) "\u{a0}%"
                @if let Some(share) = grouping.accuracy_of_three { ", " (percent(share)) "\u{a0}% with three sweeps" }
            }
            p {
                @match grouping.stability {
                    Some(index) => {
                        "Stability: " (decimal(index, 2)) ", the mean adjusted Rand index against groupings of resampled matrices "
                        "(1: always the same, 0: chance)."
                    }
                    None => "Stability: unknown.",
                }
                @if grouping.consecutive { " Every group is consecutive in label order." }
                @else { " Not every group is consecutive in label order." }
            }
            (scroll(&format!("Groups of {name}"), &plain(&html! {}, &headings, &rows)))
        }
    }
}
