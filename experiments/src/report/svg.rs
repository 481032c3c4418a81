//! The few pieces of SVG that the figures share. Colours come from classes alone, so that they follow the theme.

use super::text::escape;

/// Classes `s0` to `s7` of the style sheet: colour, dash pattern and, here, a marker each.
pub(super) const SERIES: usize = 8;

/// A figure of fixed size that shrinks with the page.
pub(super) fn figure(width: f64, height: f64, title: &str, content: &str) -> String {
    format!(
        "<svg class=\"figure\" role=\"img\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\"><title>{}</title>\n{content}</svg>\n",
        escape(title)
    )
}

/// A rectangle in which two quantities are drawn.
pub(super) struct Axes {
    /// Left edge, user units.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
    /// Largest value to the right; the smallest is 0.
    pub x_max: f64,
    /// Largest value at the top; the smallest is 0.
    pub y_max: f64,
}

impl Axes {
    /// Horizontal position of a value.
    pub fn x(&self, value: f64) -> f64 {
        self.left + self.width * value / self.x_max
    }

    /// Vertical position of a value.
    pub fn y(&self, value: f64) -> f64 {
        self.top + self.height * (1.0 - value / self.y_max)
    }

    /// Grid and labels of the vertical axis, percent.
    pub fn rows(&self, step: f64, label: &str) -> String {
        let mut svg = String::new();
        for value in ticks(self.y_max, step) {
            let (y, right) = (self.y(value), self.left + self.width);
            svg.push_str(&format!(
                "<line class=\"grid\" x1=\"{:.1}\" x2=\"{right:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
                 <text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{:.0}</text>\n",
                self.left,
                self.left - 6.0,
                y + 4.0,
                100.0 * value
            ));
        }
        let middle = self.top + self.height / 2.0;
        svg.push_str(&format!(
            "<text class=\"middle label\" transform=\"translate(12 {middle:.1}) rotate(-90)\">{label}</text>\n"
        ));
        svg
    }

    /// Grid and labels of the horizontal axis, percent.
    pub fn columns(&self, step: f64, label: &str) -> String {
        let mut svg = String::new();
        let bottom = self.top + self.height;
        for value in ticks(self.x_max, step) {
            let x = self.x(value);
            svg.push_str(&format!(
                "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{bottom:.1}\"/>\
                 <text class=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{:.0}</text>\n",
                self.top,
                bottom + 16.0,
                100.0 * value
            ));
        }
        svg.push_str(&format!(
            "<text class=\"middle label\" x=\"{:.1}\" y=\"{:.1}\">{label}</text>\n",
            self.left + self.width / 2.0,
            bottom + 34.0
        ));
        svg
    }

    /// Grid and labels of the horizontal axis at given places.
    pub fn marks(&self, marks: &[(f64, String)], label: &str) -> String {
        let mut svg = String::new();
        let bottom = self.top + self.height;
        for (value, name) in marks {
            let x = self.x(*value);
            svg.push_str(&format!(
                "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{bottom:.1}\"/>\
                 <text class=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>\n",
                self.top,
                bottom + 16.0,
                escape(name)
            ));
        }
        svg.push_str(&format!(
            "<text class=\"middle label\" x=\"{:.1}\" y=\"{:.1}\">{label}</text>\n",
            self.left + self.width / 2.0,
            bottom + 34.0
        ));
        svg
    }

    /// A line through `points` with a marker on each `marker_every`-th of them.
    pub fn series(&self, series: usize, points: &[(f64, f64)], marker_every: usize) -> String {
        let places: Vec<(f64, f64)> = points
            .iter()
            .map(|&(x, y)| (self.x(x), self.y(y)))
            .collect();
        let path: Vec<String> = places
            .iter()
            .map(|(x, y)| format!("{x:.1},{y:.1}"))
            .collect();
        let markers: String = places
            .iter()
            .step_by(marker_every.max(1))
            .map(|&(x, y)| marker(series, x, y))
            .collect();
        format!(
            "<g class=\"series s{}\"><polyline points=\"{}\"/>{markers}</g>\n",
            series % SERIES,
            path.join(" ")
        )
    }
}

/// The marker of a series.
pub(super) fn marker(series: usize, x: f64, y: f64) -> String {
    let outline = match series % SERIES {
        0 => return format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\"/>"),
        1 => "m-3.2-3.2h6.4v6.4h-6.4z",
        2 => "m0-4.4 4.2 7.4h-8.4z",
        3 => "m0-4.8 4.8 4.8-4.8 4.8-4.8-4.8z",
        4 => "m0 4.4 4.2-7.4h-8.4z",
        5 => "m-1.4-4.4h2.8v3h3v2.8h-3v3h-2.8v-3h-3v-2.8h3z",
        6 => "m-4.4-1.6h8.8v3.2h-8.8z",
        _ => "m-1.6-4.4h3.2v8.8h-3.2z",
    };
    format!("<path d=\"M{x:.1} {y:.1}{outline}\"/>")
}

/// Names beside the line and marker of their series.
pub(super) fn legend(names: &[String]) -> String {
    let entries: String = names
        .iter()
        .enumerate()
        .map(|(series, name)| {
            format!(
                "<li><svg class=\"key\" aria-hidden=\"true\" width=\"34\" height=\"12\"><g class=\"series s{}\">\
                 <polyline points=\"0,6 34,6\"/>{}</g></svg> {}</li>",
                series % SERIES,
                marker(series, 17.0, 6.0),
                escape(name)
            )
        })
        .collect();
    format!("<ul class=\"legend\">{entries}</ul>\n")
}

/// Multiples of `step` from 0 to `max`.
fn ticks(max: f64, step: f64) -> impl Iterator<Item = f64> {
    let count = (max / step + 1e-9).floor() as usize;
    (0..=count).map(move |k| k as f64 * step)
}
