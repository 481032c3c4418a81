//! Where a study's numbers come from.

use tactnet_plot::escape;

use super::super::text::{commits, duration, hash, scroll};
use crate::TaskRecord;

pub(super) fn tasks(records: &[TaskRecord]) -> String {
    let lines: String = records
        .iter()
        .map(|task| {
            let chosen: Vec<String> = task.chosen.iter().map(|(name, value)| format!("{name} = {value}")).collect();
            format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td class=\"number\">{}</td><td>{}</td></tr>\n",
                escape(&task.id),
                escape(&task.split),
                hash(&task.split_sha256),
                hash(&task.recipe_sha256),
                commits(&task.git),
                duration(task.seconds),
                escape(&chosen.join("; "))
            )
        })
        .collect();
    let table = format!(
        "<table>\n<thead><tr><th scope=\"col\">Task</th><th scope=\"col\">Split</th><th scope=\"col\">Its hash</th><th scope=\"col\">Recipe</th>\
         <th scope=\"col\">Commit</th><th scope=\"col\">Time</th><th scope=\"col\">Chosen</th></tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n"
    );
    format!(
        "<details><summary>All {} tasks that have ended</summary>\n<div class=\"inset\">\n{}</div>\n</details>\n",
        records.len(),
        scroll("Tasks", &table)
    )
}
