//! The confusion matrix as a picture (SVG).

use std::fmt::Write;

use crate::Predictions;

const CELL: usize = 18;
const NAMES: usize = 230;
const TOP: usize = 60;

impl Predictions {
    /// A self-contained SVG: rows are true materials, columns predicted ones, darkness the share of the row; counts show
    /// on hover.
    pub fn confusion_svg(&self, title: &str) -> String {
        let materials = self.labels.len();
        let side = materials * CELL;
        let (width, height) = (NAMES + side + 20, TOP + side + 50);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\" role=\"img\">\n\
             <title>{title}</title>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <text x=\"10\" y=\"20\" font-size=\"14\" fill=\"#222\">{title}</text>\n\
             <text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"#222\">true material</text>\n\
             <text x=\"{NAMES}\" y=\"{}\" fill=\"#222\">predicted label</text>\n",
            NAMES - 6,
            TOP - 12,
            TOP + side + 34,
            title = escape(title),
        );
        for (label, (row, name)) in self.confusion().iter().zip(self.labels.names()).enumerate() {
            let y = TOP + label * CELL;
            let total = row.iter().sum::<usize>().max(1);
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"end\" fill=\"#222\">{} · {label}</text>",
                NAMES - 6,
                y + CELL - 5,
                escape(name)
            );
            for (predicted, count) in row.iter().enumerate() {
                let share = *count as f64 / total as f64;
                let _ = writeln!(
                    svg,
                    "<rect x=\"{}\" y=\"{y}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{}\" stroke=\"#ddd\" \
                     stroke-width=\"0.5\"><title>{} taken for {}: {count} of {total}</title></rect>",
                    NAMES + predicted * CELL,
                    shade(share),
                    escape(name),
                    escape(self.labels.name(predicted)),
                );
            }
        }
        for label in 0..materials {
            let _ = writeln!(
                svg,
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"9\" fill=\"#222\">{label}</text>",
                NAMES + label * CELL + CELL / 2,
                TOP + side + 14
            );
        }
        svg.push_str("</svg>\n");
        svg
    }
}

/// White to dark blue; the square root keeps rare confusions visible.
fn shade(share: f64) -> String {
    let depth = share.sqrt();
    let mix = |dark: f64| (255.0 + (dark - 255.0) * depth).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(8.0), mix(48.0), mix(107.0))
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
