//! Accuracy of every material as a bar.

use tactnet_plot::{escape, figure, text_width};

use super::confusion::NAME_LIMIT;
use super::text::{percent, shortened};

/// A column of bars, from 0 to 100 %, one for each material.
///
/// - `(left, top)`: upper left corner of the first bar's line
/// - `(width, line)`: of the longest bar; height of a bar's line
/// - `series`: whose colour it takes
pub(super) fn column(
    accuracies: &[f64],
    heading: &str,
    (left, top): (f64, f64),
    (width, line): (f64, f64),
    series: usize,
) -> String {
    let height = line * accuracies.len() as f64;
    let mut svg = format!(
        "<text class=\"label\" x=\"{left:.1}\" y=\"{:.1}\">{}</text>\n<g class=\"bars s{series}\">\n",
        top - 6.0,
        escape(heading)
    );
    for share in [0.0, 0.5, 1.0] {
        let x = left + width * share;
        svg.push_str(&format!(
            "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{top:.1}\" y2=\"{:.1}\"/>",
            top + height
        ));
    }
    for (k, &accuracy) in accuracies.iter().enumerate() {
        let y = top + line * k as f64;
        svg.push_str(&format!(
            "<rect x=\"{left:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            y + 0.15 * line,
            width * accuracy.clamp(0.0, 1.0),
            0.7 * line,
            left + width + 5.0,
            y + line / 2.0 + 4.0,
            percent(accuracy)
        ));
    }
    svg.push_str("</g>\n");
    svg
}

/// Several columns of bars beside the names of the materials.
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
    let mut content = String::new();
    for (k, label) in labels.iter().enumerate() {
        content.push_str(&format!(
            "<text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            margin - 8.0,
            top + line * (k as f64 + 0.5) + 4.0,
            escape(label)
        ));
    }
    for (series, (heading, accuracies)) in columns.iter().enumerate() {
        let left = margin + step * series as f64;
        content.push_str(&column(
            accuracies,
            heading,
            (left, top),
            (width, line),
            series,
        ));
    }
    figure(
        margin + step * columns.len() as f64,
        top + line * names.len() as f64 + 8.0,
        title,
        &content,
    )
}
