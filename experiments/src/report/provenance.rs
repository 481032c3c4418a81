//! Where the numbers come from, folded: the run, and behind every row the folds it was made from.

use tactnet_plot::escape;

use super::data_set::{DataSet, split_name};
use super::text::{commits, duration, file_link, hash, percent, scroll};
use crate::Summary;
use crate::questions::Scored;

/// Command, commit, seed, processor and data of a run.
pub(super) fn run(summary: &Summary) -> String {
    let data: String = summary
        .data
        .iter()
        .map(|(name, data)| format!("<li>{} {}</li>", escape(name), hash(&data.sha256)))
        .collect();
    let data = if data.is_empty() {
        data
    } else {
        format!("<ul>{data}</ul>")
    };
    let facts: String = [
        (
            "Command",
            format!("<code>{}</code>", escape(&summary.command)),
        ),
        ("Commit", commits(&summary.git)),
        ("Seed", summary.seed.to_string()),
        ("Data, SHA-256", data),
        ("Processor", escape(&summary.processors.join("; "))),
        (
            "Tasks",
            format!("{} of {} done", summary.tasks_done, summary.tasks),
        ),
        (
            "Training time",
            format!("{}, all tasks together", duration(summary.train_seconds)),
        ),
        ("The recipe expects", escape(&summary.expects)),
    ]
    .iter()
    .filter(|(_, fact)| !fact.is_empty())
    .map(|(term, fact)| format!("<div><dt>{term}</dt><dd>{fact}</dd></div>\n"))
    .collect();
    format!(
        "<details><summary>The run: command, commit, seed, data</summary>\n<dl class=\"facts\">\n{facts}</dl>\n</details>\n"
    )
}

/// The run and the folds of a cross-validation.
pub(super) fn section(summary: &Summary, contenders: &[Scored<'_>], sets: &[DataSet]) -> String {
    let run = run(summary);
    if contenders.is_empty() {
        return run;
    }
    format!(
        "{run}<details><summary>Folds of all {} rows: commit, split, recipe, command, predictions</summary>\n\
         <div class=\"inset\">\n{}</div>\n</details>\n",
        contenders.len(),
        folds(summary, contenders, sets)
    )
}

fn folds(summary: &Summary, contenders: &[Scored<'_>], sets: &[DataSet]) -> String {
    let mut html = String::new();
    for (index, row) in contenders.iter().enumerate() {
        let Some(set) = sets
            .iter()
            .find(|set| set.data == row.data && set.levels == row.levels)
        else {
            continue;
        };
        let folds: String = row
            .folds
            .iter()
            .filter_map(|fold| {
                let task = summary.records.iter().find(|task| task.id == fold.task)?;
                Some(format!(
                    "<tr><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td>{}</td>\
                     <td>{}</td><td>{}</td><td><code>{}</code></td><td>{}</td></tr>\n",
                    fold.repeat,
                    fold.fold,
                    percent(fold.one_sweep),
                    commits(&task.git),
                    hash(&task.split_sha256),
                    hash(&task.recipe_sha256),
                    escape(&task.command),
                    file_link(&fold.predictions)
                ))
            })
            .collect();
        let table = format!(
            "<table>\n<thead><tr><th scope=\"col\">Run</th><th scope=\"col\">Fold</th><th scope=\"col\">1 sweep, %</th>\
             <th scope=\"col\">Commit</th><th scope=\"col\">Split</th><th scope=\"col\">Recipe</th>\
             <th scope=\"col\">Command</th><th scope=\"col\">Predictions</th></tr></thead>\n<tbody>\n{folds}</tbody>\n</table>\n"
        );
        let published = row
            .published
            .map(|published| {
                format!(
                    " Published beside it: {}, on TactMat.",
                    escape(&published.classifier)
                )
            })
            .unwrap_or_default();
        let name = format!("{}: {}", set.heading(), set.name(row));
        html.push_str(&format!(
            "<details id=\"row-{index}\"><summary>{}</summary>\n<p>{} training and {} test sweeps a fold, {} time steps \
             each; test sweeps: {}.{published} Commits, splits and recipes are shortened hashes; the full ones are their titles.</p>\n{}</details>\n",
            escape(&name),
            row.n_train,
            row.n_test,
            row.steps,
            escape(&split_name(row.split)),
            scroll(&format!("Folds of {name}"), &table)
        ));
    }
    html
}

#[cfg(test)]
mod tests {
    use super::super::fake;
    use super::*;

    #[test]
    fn everything_that_repeats_a_run_is_folded() {
        let run = run(&fake::summary());
        let folded = run.strip_prefix("<details><summary>").unwrap();
        assert!(folded.ends_with("</details>\n") && !run.contains("<details open"));
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
        assert!(!super::run(&fake::empty()).contains("expects"));
    }
}
