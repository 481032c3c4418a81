//! Provenance of a study's numbers.

use maud::{Markup, html};

use super::super::table::{Heading, plain};
use super::super::text::{commits, duration, hash, scroll};
use crate::TaskRecord;

/// Returns the folded table of all finished tasks.
pub(super) fn tasks(records: &[TaskRecord]) -> Markup {
    let chosen = |task: &TaskRecord| {
        let chosen = task
            .chosen
            .iter()
            .map(|(name, value)| format!("{name} = {value}"));
        chosen.collect::<Vec<_>>().join("; ")
    };
    let rows = html! {
        @for task in records {
            tr {
                td { (task.id) }
                td { (task.split) }
                td { (hash(&task.split_sha256)) }
                td { (hash(&task.recipe_sha256)) }
                td { (commits(&task.git)) }
                td.number { (duration(task.seconds)) }
                td { (chosen(task)) }
            }
        }
    };
    let headings = [
        "Task",
        "Split",
        "Split hash",
        "Recipe",
        "Commit",
        "Time",
        "Selected",
    ]
    .map(Heading::text);
    html! {
        details {
            summary { "All " (records.len()) " finished tasks" }
            div.inset { (scroll("Tasks", &plain(&html! {}, &headings, &rows))) }
        }
    }
}
