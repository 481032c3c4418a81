//! Methods on the same tasks, and what transfer saves.

use tactnet_plot::escape;

use super::super::results::Heading::{Number, Text};
use super::super::results::{number, sortable};
use super::super::text::{ABSENT, decimal, p_value, percent, scroll};
use super::count;
use crate::comparison::name_beside;
use crate::{SampleEfficiency, Summary};

pub(super) fn comparisons(study: &Summary) -> String {
    let lines: String = study
        .comparisons
        .iter()
        .filter_map(|comparison| {
            let first = study.row(&comparison.first)?;
            let second = study.row(&comparison.second)?;
            let points = 100.0 * comparison.difference;
            let ends = match comparison.ci95 {
                Some([low, high]) => format!("[{}, {}]", decimal(100.0 * low, 1), decimal(100.0 * high, 1)),
                _ => ABSENT.to_string(),
            };
            let data = if first.model == second.model {
                format!("{}, networks by {}", first.data, first.model)
            } else {
                first.data.clone()
            };
            Some(format!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td>{}{}<td>{}</td><td>{}</td>{}{}{}{}{}</tr>\n",
                escape(&data),
                escape(first.levels.name()),
                escape(first.measure.name()),
                escape(&first.setting),
                count(first.shots),
                count(first.sweeps),
                escape(name_beside(first, second)),
                escape(name_beside(second, first)),
                number(Some(points), &decimal(points, 1)),
                number(comparison.ci95.map(|ends| ends[0]), &ends),
                number(comparison.p, &comparison.p.map(p_value).unwrap_or_default()),
                number(comparison.p_holm, &comparison.p_holm.map(p_value).unwrap_or_default()),
                number(Some(comparison.n as f64), &comparison.n.to_string())
            ))
        })
        .collect();
    let table = format!(
        "<table class=\"sortable\">\n<caption class=\"hidden\">Differences on the same tasks</caption>\n<thead><tr>{}</tr></thead>\n\
         <tbody>\n{lines}</tbody>\n</table>\n",
        sortable(&[
            Text("Data"),
            Text("Levels"),
            Text("Measure"),
            Text("Setting"),
            Number("Shots"),
            Number("Sweeps"),
            Text("First"),
            Text("Second"),
            Number("First \u{2212} second<br><small>points</small>"),
            Number("95 % interval"),
            Number("p"),
            Number("p, Holm"),
            Number("Tasks"),
        ])
    );
    format!(
        "<p>Differences on the same tasks. p is two-sided; beside it after Holm's correction for all comparisons of a measure on one data set.</p>\n{}",
        scroll("Paired comparisons", &table)
    )
}

pub(super) fn efficiency(efficiency: &[SampleEfficiency]) -> String {
    let published = efficiency
        .iter()
        .any(|found| found.published_ratio.is_some());
    let lines: String = efficiency
        .iter()
        .map(|found| {
            let shots = |value: Option<f64>| value.map_or("more than tried".to_string(), |value| decimal(value, 1));
            format!(
                "<tr><td>{}</td><td>{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td><td class=\"number\">{}</td>\
                 <td class=\"number\">{}</td><td class=\"number\">{}</td>{}</tr>\n",
                escape(&format!("{}, networks by {}", found.data, found.model)),
                escape(found.levels.name()),
                found.transfer_shots,
                percent(found.accuracy),
                shots(found.shots),
                found
                    .ci95
                    .map_or(ABSENT.to_string(), |ends| format!("{} to {}", shots(ends[0]), shots(ends[1]))),
                found
                    .shots
                    .map_or(ABSENT.to_string(), |shots| decimal(shots / found.transfer_shots as f64, 1)),
                if published {
                    number(
                        found.published_ratio,
                        &found.published_ratio.map(|ratio| decimal(ratio, 0)).unwrap_or_default(),
                    )
                } else {
                    String::new()
                }
            )
        })
        .collect();
    let table = format!(
        "<table>\n<caption class=\"hidden\">Sweeps saved by transfer</caption>\n<thead><tr><th scope=\"col\">Data</th><th scope=\"col\">Levels</th>\
         <th scope=\"col\" class=\"number\">Shots of transfer</th><th scope=\"col\" class=\"number\">Its accuracy, %</th>\
         <th scope=\"col\" class=\"number\">Shots without pre-knowledge</th><th scope=\"col\" class=\"number\">95 % interval</th>\
         <th scope=\"col\" class=\"number\">Ratio</th>{}</tr></thead>\n<tbody>\n{lines}</tbody>\n</table>\n",
        if published {
            "<th scope=\"col\" class=\"number\">Published ratio</th>"
        } else {
            ""
        }
    );
    format!(
        "<p>Sweeps of every new material that a network without pre-knowledge needs to be as good as OL-mean. Between tested numbers a straight \
         line over their logarithm; intervals by bootstrap over draws of the materials.</p>\n{}",
        scroll("Sweeps saved", &table)
    )
}
