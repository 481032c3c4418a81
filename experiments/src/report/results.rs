//! The table of results, and behind every row the folds it was made from.

use tactnet_plot::escape;

use super::data_set::{DataSet, prediction_name, split_name};
use super::text::{
    ABSENT, commits, decimal, file_link, hash, percent, percent_and_sd, percent_interval, scroll,
};
use crate::questions::Scored;
use crate::{Statistic, Summary};

use Heading::{Number, Text};

pub(super) fn section(summary: &Summary, contenders: &[Scored<'_>], sets: &[DataSet]) -> String {
    if contenders.is_empty() {
        return "<p>No task has ended yet.</p>\n".to_string();
    }
    let published = contenders.iter().any(|row| row.published.is_some());
    let mut headings = vec![
        Text("Data"),
        Text("Model"),
        Text("Levels"),
        Text("Split"),
        Text("Prediction"),
        Number("Steps"),
        Number("1 sweep<br><small>% (sd)</small>"),
        Number("95 % interval<br><small>1 sweep, %</small>"),
        Number("\u{3c3}<sub>test</sub><br><small>%</small>"),
        Number("3 sweeps<br><small>% (sd)</small>"),
        Number("NLL<br><small>nats</small>"),
        Number("ECE<br><small>%</small>"),
        Number("Brier<br><small>0 to 2</small>"),
        Number("Training<br><small>s/fold</small>"),
        Number("Folds"),
    ];
    if published {
        headings.push(Number("1 sweep, %<br><small>published, TactMat</small>"));
        headings.push(Number("3 sweeps, %<br><small>published, TactMat</small>"));
    }
    let body = |probe: bool| -> String {
        contenders
            .iter()
            .enumerate()
            .filter(|(_, row)| row.probe == probe)
            .map(|(index, row)| line(index, row, published))
            .collect()
    };
    let mut table = format!(
        "<table class=\"sortable results\">\n<caption class=\"hidden\">Accuracy and calibration of every model</caption>\n\
         <thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody>\n",
        sortable(&headings),
        body(false)
    );
    let probes = body(true);
    if !probes.is_empty() {
        table.push_str(&format!(
            "<tbody>\n<tr class=\"separator\"><th scope=\"rowgroup\" colspan=\"{}\"><span>Probes: what the data give \
             away, not contenders</span></th></tr>\n{probes}</tbody>\n",
            headings.len()
        ));
    }
    table.push_str("</table>\n");
    format!(
        "<p>Means over folds. Intervals know that folds share training sweeps (Nadeau and Bengio, 2003). Accuracies are in \
         percent; for NLL, ECE and Brier, smaller is better. A model's name leads to its folds.</p>\n{}\
         <h3>Where the numbers come from</h3>\n\
         <details><summary>Folds of all {} rows: commit, split, recipe, command, predictions</summary>\n\
         <div class=\"inset\">\n{}</div>\n</details>\n",
        scroll("Results table", &table),
        contenders.len(),
        provenance(summary, contenders, sets)
    )
}

/// Heading of a column, as HTML, and whether the column holds text or numbers.
pub(super) enum Heading {
    Text(&'static str),
    Number(&'static str),
}

/// Header cells whose buttons sort the table.
pub(super) fn sortable(headings: &[Heading]) -> String {
    headings
        .iter()
        .map(|heading| {
            let (class, heading) = match heading {
                Heading::Text(heading) => ("", heading),
                Heading::Number(heading) => (" class=\"number\"", heading),
            };
            format!("<th scope=\"col\"{class} aria-sort=\"none\"><button type=\"button\">{heading}</button></th>")
        })
        .collect()
}

/// A cell that sorts by `value` and shows `shown`.
pub(super) fn number(value: Option<f64>, shown: &str) -> String {
    match value.filter(|value| value.is_finite()) {
        Some(value) => format!("<td class=\"number\" data-value=\"{value}\">{shown}</td>"),
        None => format!("<td class=\"number\">{ABSENT}</td>"),
    }
}

fn line(index: usize, row: &Scored<'_>, published: bool) -> String {
    let plain = |statistic: &Statistic, scale: f64, decimals: usize| {
        let mean = scale * statistic.mean;
        number(Some(mean), &decimal(mean, decimals))
    };
    let accuracy = |statistic: Option<&Statistic>| {
        number(
            statistic.map(|s| s.mean),
            &statistic.map(percent_and_sd).unwrap_or_default(),
        )
    };
    let mut cells = format!(
        "<td>{}</td><th scope=\"row\"><a href=\"#row-{index}\">{}</a></th><td>{}</td><td>{}</td><td>{}</td>",
        escape(row.data),
        escape(row.model),
        escape(row.levels.name()),
        escape(&split_name(row.split)),
        prediction_name(row.prediction),
    );
    let seconds = row.train_seconds.mean;
    cells.push_str(&number(Some(row.steps as f64), &row.steps.to_string()));
    cells.push_str(&accuracy(Some(row.one_sweep)));
    cells.push_str(&number(
        row.one_sweep.ci95.map(|ci| ci[0]),
        &percent_interval(row.one_sweep),
    ));
    cells.push_str(&number(Some(row.sigma_test), &percent(row.sigma_test)));
    cells.push_str(&accuracy(row.three_sweeps));
    cells.push_str(&plain(row.negative_log_likelihood, 1.0, 3));
    cells.push_str(&plain(row.expected_calibration_error, 100.0, 1));
    cells.push_str(&plain(row.brier, 1.0, 3));
    cells.push_str(&plain(
        row.train_seconds,
        1.0,
        if seconds < 100.0 { 1 } else { 0 },
    ));
    cells.push_str(&number(
        Some(row.folds.len() as f64),
        &row.folds.len().to_string(),
    ));
    if published {
        for value in [
            row.published.map(|p| p.one_sweep),
            row.published.map(|p| p.three_sweeps),
        ] {
            cells.push_str(&number(
                value,
                &value.map(|v| decimal(v, 1)).unwrap_or_default(),
            ));
        }
    }
    format!("<tr>{cells}</tr>\n")
}

fn provenance(summary: &Summary, contenders: &[Scored<'_>], sets: &[DataSet]) -> String {
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
             each; split {}.{published} Commits, splits and recipes are shortened hashes; the full ones are their titles.</p>\n{}</details>\n",
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
