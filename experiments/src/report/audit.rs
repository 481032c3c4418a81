//! The section on probes: information in each data set other than texture.

use maud::{Markup, html};

use super::table::{Heading, plain};
use super::text::{percent, prose};
use crate::phrases::listed;
use crate::{Audit, Summary};

/// Returns a table for each data set; `None` without probes.
pub(super) fn section(summary: &Summary) -> Option<Markup> {
    (!summary.audits.is_empty()).then(|| {
        html! {
            p {
                "A classifier can score well without texture: by the level of each taxel, or by recognising the recording "
                "block. These probes measure how accurate that is."
            }
            div.cards { @for audit in &summary.audits { (card(audit)) } }
        }
    })
}

fn card(audit: &Audit) -> Markup {
    let best = match &audit.best {
        Some((model, _)) if !audit.tied.is_empty() => format!(
            "Best contender ({model}; as accurate: {}), random folds",
            listed(&audit.tied)
        ),
        Some((model, _)) => format!("Best contender ({model}), random folds"),
        None => "Best contender, random folds".into(),
    };
    let measured = [
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
        ("Nearest neighbour on the first frame", audit.first_frame),
        ("Nearest neighbour on the last frame", audit.last_frame),
        (
            "Nearest training sweep in the order of the file, random folds",
            audit.recording_order,
        ),
        (
            "Training sweep of the nearest length, random folds",
            audit.sweep_length,
        ),
        (
            "Recording block within a material, by taxel means, random folds",
            audit.block_identity.map(|of| of.accuracy),
        ),
        ("MiniRocket on permuted labels", audit.permuted),
    ];
    let (chance, sigma) = (percent(audit.chance), percent(audit.chance_sigma));
    let rows = html! {
        @for (measure, accuracy) in measured {
            @if let Some(accuracy) = accuracy {
                tr { th scope="row" { (measure) } td.number { (percent(accuracy)) } }
            }
        }
        tr { th scope="row" { "Chance (sd of guessing)" } td.number { (chance) " (" (sigma) ")" } }
    };
    let headings = [Heading::text("Measured"), Heading::number("1 sweep, %", "")];
    html! {
        div.card {
            h3 { (audit.data) }
            (plain(&html! {}, &headings, &rows))
            p { (prose(&audit.verdict)) }
        }
    }
}
