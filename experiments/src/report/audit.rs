//! What each data set gives away without texture.

use tactnet_plot::escape;

use super::text::{percent, prose};
use crate::questions::listed;
use crate::{Audit, Summary};

/// Returns a table for each data set; `None` if none was probed.
pub(super) fn section(summary: &Summary) -> Option<String> {
    if summary.audits.is_empty() {
        return None;
    }
    let audits: String = summary.audits.iter().map(audit).collect();
    Some(format!(
        "<p>A classifier can score well without feeling texture: by the level of each taxel, or by recognising the recording \
         block. These probes show how far that would get it.</p>\n<div class=\"cards\">\n{audits}</div>\n"
    ))
}

fn audit(audit: &Audit) -> String {
    let best = match &audit.best {
        Some((model, _)) if !audit.tied.is_empty() => format!(
            "Best contender ({}; as accurate: {}), random folds",
            escape(model),
            escape(&listed(&audit.tied))
        ),
        Some((model, _)) => format!("Best contender ({}), random folds", escape(model)),
        None => "Best contender, random folds".to_string(),
    };
    let lines: String = [
        (
            best.as_str(),
            audit.best.as_ref().map(|(_, accuracy)| *accuracy),
        ),
        (
            "The same model, one recording block left out",
            audit.block_out,
        ),
        (
            "Nearest neighbour on taxel means (levels alone)",
            audit.means,
        ),
        ("MiniRocket on permuted labels", audit.permuted),
    ]
    .iter()
    .filter_map(|(measure, accuracy)| {
        let shown = percent((*accuracy)?);
        Some(format!(
            "<tr><th scope=\"row\">{measure}</th><td class=\"number\">{shown}</td></tr>\n"
        ))
    })
    .collect();
    format!(
        "<div class=\"card\">\n<h3>{}</h3>\n<table>\n<thead><tr><th scope=\"col\">Measured</th>\
         <th scope=\"col\" class=\"number\">1 sweep, %</th></tr></thead>\n<tbody>\n{lines}\
         <tr><th scope=\"row\">Chance (sd of guessing)</th><td class=\"number\">{} ({})</td></tr>\n</tbody>\n</table>\n\
         <p>{}</p>\n</div>\n",
        escape(&audit.data),
        percent(audit.chance),
        percent(audit.chance_sigma),
        prose(&audit.verdict)
    )
}
