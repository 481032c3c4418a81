//! Confusion matrix as an SVG figure.

use tactnet_plot::{HeatMap, escape, stand_alone, text_width};

use crate::Predictions;

/// Side of a cell without a count, in user units.
const CELL: f64 = 18.0;
/// Side of a cell with a count, in user units.
const COUNTED: f64 = 30.0;
/// Maximum number of materials for which cells show counts.
const MOST_COUNTED: usize = 16;
const TOP: f64 = 60.0;

impl Predictions {
    /// Returns a self-contained SVG with a row per true material, a column per predicted one, and the share of the row as darkness. Cells show
    /// counts if there are few materials, else on hover.
    pub fn confusion_svg(&self, title: &str) -> String {
        let confusion = self.confusion();
        let totals: Vec<usize> = confusion.iter().map(|row| row.iter().sum()).collect();
        let names: Vec<String> = self
            .labels
            .names()
            .enumerate()
            .map(|(label, name)| format!("{name} · {label}"))
            .collect();
        let left = 16.0 + 1.2 * text_width(&names).max(text_width(&["true material"]));
        let counted = names.len() <= MOST_COUNTED;
        let cell = if counted { COUNTED } else { CELL };
        let side = cell * names.len() as f64;
        let (right, bottom) = (left + side, TOP + side);
        let shares: Vec<Vec<f64>> = confusion
            .iter()
            .zip(&totals)
            .map(|(row, total)| {
                row.iter()
                    .map(|count| *count as f64 / (*total).max(1) as f64)
                    .collect()
            })
            .collect();
        let map = HeatMap {
            left,
            top: TOP,
            cell,
        };
        let mut content = format!(
            "<text x=\"10\" y=\"20\">{}</text>\n\
             <text class=\"end label\" x=\"{:.1}\" y=\"{:.1}\">true material</text>\n\
             <text class=\"label\" x=\"{left:.1}\" y=\"{:.1}\">predicted label</text>\n",
            escape(title),
            left - 6.0,
            TOP - 12.0,
            bottom + 34.0
        );
        content.push_str(&map.draw(&shares, |truth, predicted| {
            format!(
                "{} taken for {}: {} of {}",
                self.labels.name(truth),
                self.labels.name(predicted),
                confusion[truth][predicted],
                totals[truth]
            )
        }));
        for (label, name) in names.iter().enumerate() {
            content.push_str(&lines_of(&map, label, name, side));
        }
        if counted {
            content.push_str(&counts(&map, &confusion));
        }
        let width = (right + 20.0).max(20.0 + 1.2 * text_width(&[title]));
        stand_alone(width, bottom + 50.0, title, &content)
    }
}

/// Returns grid lines, names and number of a material, for its row and its column.
///
/// - `side`: extent of the map
fn lines_of(map: &HeatMap, label: usize, name: &str, side: f64) -> String {
    let &HeatMap { left, top, cell } = map;
    let (right, bottom) = (left + side, top + side);
    let start = cell * label as f64;
    let middle = start + cell / 2.0;
    format!(
        "<path class=\"grid\" d=\"M{left:.1} {:.1}H{right:.1}M{:.1} {top:.1}V{bottom:.1}\"/>\
         <text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\
         <text class=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{label}</text>\n",
        top + start,
        left + start,
        left - 6.0,
        top + middle + 4.0,
        escape(name),
        left + middle,
        bottom + 14.0
    )
}

/// Returns the numbers in the cells that are not 0.
fn counts(map: &HeatMap, confusion: &[Vec<usize>]) -> String {
    let mut content = String::new();
    for (truth, row) in confusion.iter().enumerate() {
        for (predicted, &count) in row.iter().enumerate().filter(|(_, count)| **count > 0) {
            content.push_str(&format!(
                "<text class=\"middle\" x=\"{:.1}\" y=\"{:.1}\" pointer-events=\"none\">{count}</text>\n",
                map.left + map.cell * (predicted as f64 + 0.5),
                map.top + map.cell * (truth as f64 + 0.5) + 4.0,
            ));
        }
    }
    content
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PredictionMethod, SweepScore};
    use tactnet_data::LabelSet;

    #[test]
    fn the_picture_shows_every_count_and_is_a_file_of_its_own() {
        let sweep = |index, label, p: [f64; 2]| SweepScore {
            index,
            label,
            log_probability: p.map(f64::ln).to_vec(),
        };
        let predictions = Predictions {
            labels: LabelSet::new(["cork", "<b>"]).unwrap(),
            method: PredictionMethod::Plain,
            sweeps: vec![
                sweep(0, 0, [0.9, 0.1]),
                sweep(1, 0, [0.2, 0.8]),
                sweep(2, 1, [0.3, 0.7]),
            ],
        };
        let svg = predictions.confusion_svg("a & b");
        for text in [
            "cork taken for cork: 1 of 2",
            "cork taken for &lt;b&gt;: 1 of 2",
            "&lt;b&gt; taken for &lt;b&gt;: 1 of 1",
            "&lt;b&gt; · 1",
            "a &amp; b",
            "pointer-events=\"none\">1</text>",
        ] {
            assert!(svg.contains(text), "{text} in {svg}");
        }
        assert!(svg.contains("xmlns=") && !svg.contains("var("));
        for name in ["text", "title", "g", "rect"] {
            let open = svg.matches(&format!("<{name} ")).count()
                + svg.matches(&format!("<{name}>")).count();
            let closed = svg.matches(&format!("</{name}>")).count();
            let empty = if name == "rect" { 2 } else { 0 };
            assert_eq!(open, closed + empty, "<{name}>");
        }
    }
}
