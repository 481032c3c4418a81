//! Bars with the accuracy of each material.

use maud::{Markup, html};
use tactnet_plot::{figure, text_width};

use super::text::{NAME_LIMIT, percent, px, shortened};

/// Layout of a column of bars, in user units.
pub(super) struct Layout {
    /// Left end of the bars.
    pub left: f64,
    /// Top of the first line.
    pub top: f64,
    /// Width of a bar of 100 %.
    pub width: f64,
    /// Height of a line.
    pub line: f64,
}

/// Draws a column of bars from 0 to 100 %, one for each material.
///
/// - `series`: index of the colour
pub(super) fn column(accuracies: &[f64], heading: &str, layout: &Layout, series: usize) -> Markup {
    let &Layout {
        left,
        top,
        width,
        line,
    } = layout;
    let bottom = top + line * accuracies.len() as f64;
    let bars = accuracies
        .iter()
        .enumerate()
        .map(|(k, &accuracy)| (top + line * k as f64, accuracy));
    html! {
        text.label x=(px(left)) y=(px(top - 6.0)) { (heading) }
        g class={ "bars s" (series) } {
            @for x in [0.0, 0.5, 1.0].map(|share| px(left + width * share)) {
                line.grid x1=(x) x2=(x) y1=(px(top)) y2=(px(bottom)) {}
            }
            @for (y, accuracy) in bars {
                rect x=(px(left)) y=(px(y + 0.15 * line)) width=(px(width * accuracy.clamp(0.0, 1.0))) height=(px(0.7 * line)) {}
                text x=(px(left + width + 5.0)) y=(px(y + line / 2.0 + 4.0)) { (percent(accuracy)) }
            }
        }
    }
}

/// Returns a figure with several columns of bars and the names of the materials.
///
/// - `columns`: heading and one accuracy for each name
pub(super) fn table(title: &str, names: &[&str], columns: &[(&str, Vec<f64>)]) -> String {
    let (line, width, step, top) = (17.0, 110.0, 170.0, 22.0);
    let labels: Vec<String> = names
        .iter()
        .enumerate()
        .map(|(id, name)| format!("{} {id:>2}", shortened(name, NAME_LIMIT)))
        .collect();
    let margin = 10.0 + text_width(&labels);
    let layout = |series: usize| Layout {
        left: margin + step * series as f64,
        top,
        width,
        line,
    };
    let content = html! {
        @for (k, label) in labels.iter().enumerate() {
            text.end x=(px(margin - 8.0)) y=(px(top + line * (k as f64 + 0.5) + 4.0)) { (label) }
        }
        @for (series, (heading, accuracies)) in columns.iter().enumerate() {
            (column(accuracies, heading, &layout(series), series))
        }
    };
    let width = margin + step * columns.len() as f64;
    figure(
        width,
        top + line * names.len() as f64 + 8.0,
        title,
        &content.0,
    )
}
