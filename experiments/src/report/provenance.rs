//! Provenance of the numbers, folded: the run, and the folds of each row.

use maud::{Markup, html};

use super::data_set::{DataSet, split_name};
use super::table::{Heading, plain};
use super::text::{commits, duration, file_link, hash, percent, scroll};
use crate::Summary;
use crate::scored::Scored;

/// Returns command, commit, seed, processor and data of a run.
pub(super) fn run(summary: &Summary) -> Markup {
    html! {
        details {
            summary { "The run: command, commit, seed, data" }
            dl.facts {
                (fact("Command", &html! { code { (summary.command) } }))
                @if !summary.git.is_empty() { (fact("Commit", &commits(&summary.git))) }
                (fact("Seed", &html! { (summary.seed) }))
                @if !summary.data.is_empty() {
                    (fact("Data, SHA-256", &html! {
                        ul { @for (name, data) in &summary.data { li { (name) " " (hash(&data.sha256)) } } }
                    }))
                }
                @if !summary.processors.is_empty() { (fact("Processor", &html! { (summary.processors.join("; ")) })) }
                (fact("Tasks", &html! { (summary.tasks_done) " of " (summary.tasks) " done" }))
                (fact("Training time", &html! { (duration(summary.train_seconds)) ", all tasks together" }))
                @if !summary.expects.is_empty() { (fact("The recipe expects", &html! { (summary.expects) })) }
            }
        }
    }
}

fn fact(term: &str, fact: &Markup) -> Markup {
    html! { div { dt { (term) } dd { (fact) } } }
}

/// Returns the run and the folds of a cross-validation.
pub(super) fn section(summary: &Summary, contenders: &[Scored<'_>], sets: &[DataSet]) -> Markup {
    let of_set = |row: &Scored<'_>| {
        let mut sets = sets.iter();
        sets.find(|set| set.data == row.data && set.levels == row.levels)
    };
    html! {
        (run(summary))
        @if !contenders.is_empty() {
            details {
                summary { "Folds of all " (contenders.len()) " rows: commit, split, recipe, command, predictions" }
                div.inset {
                    @for (index, row) in contenders.iter().enumerate() {
                        @if let Some(set) = of_set(row) { (folds(summary, index, row, set)) }
                    }
                }
            }
        }
    }
}

/// Returns the folds of a row, which the table of results links to.
fn folds(summary: &Summary, index: usize, row: &Scored<'_>, set: &DataSet) -> Markup {
    let name = format!("{}: {}", set.heading(), set.name(row));
    let headings = [
        "Run",
        "Fold",
        "1 sweep, %",
        "Commit",
        "Split",
        "Recipe",
        "Command",
        "Predictions",
    ]
    .map(Heading::text);
    let folds = row.folds.iter().filter_map(|fold| {
        Some((
            fold,
            summary.records.iter().find(|task| task.id == fold.task)?,
        ))
    });
    let rows = html! {
        @for (fold, task) in folds {
            tr {
                td.number { (fold.repeat) }
                td.number { (fold.fold) }
                td.number { (percent(fold.one_sweep)) }
                td { (commits(&task.git)) }
                td { (hash(&task.split_sha256)) }
                td { (hash(&task.recipe_sha256)) }
                td { code { (task.command) } }
                td { (file_link(&fold.predictions)) }
            }
        }
    };
    html! {
        details id={ "row-" (index) } {
            summary { (name) }
            p {
                (row.n_train) " training and " (row.n_test) " test sweeps for each fold, " (row.steps) " time steps each; test sweeps: "
                (split_name(&row.split)) "."
                @if let Some(published) = &row.published { " Comparable published result: " (published.classifier) ", on TactMat." }
                " Commits, splits and recipes are shortened hashes; the complete ones are their titles."
            }
            (scroll(&format!("Folds of {name}"), &plain(&html! {}, &headings, &rows)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fake;
    use super::*;

    #[test]
    fn everything_that_repeats_a_run_is_folded() {
        let run = run(&fake::summary()).into_string();
        let folded = run.strip_prefix("<details><summary>").unwrap();
        assert!(folded.ends_with("</details>") && !run.contains("<details open"));
        for term in [
            "Command",
            "Commit",
            "Seed",
            "Data, SHA-256",
            "Processor",
            "The recipe expects",
        ] {
            assert!(run.contains(&format!("<dt>{term}</dt>")), "{term}");
        }
        assert!(!super::run(&fake::empty()).0.contains("expects"));
    }
}
