//! Appearance of series.

/// One of eight styles: colour, dash pattern and marker. Dash pattern and marker distinguish series without colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Series(usize);

impl Series {
    /// Number of styles.
    pub const COUNT: usize = 8;

    /// Returns the style of the series with this index; the styles repeat after eight.
    pub fn nth(index: usize) -> Self {
        Self(index % Self::COUNT)
    }

    /// Returns the marker at a position; a [`group`](Self::group) gives it its colour.
    pub fn marker(self, x: f64, y: f64) -> String {
        let outline = match self.0 {
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

    /// Returns `content` in the colour of the series, polylines with its dash pattern.
    pub fn group(self, content: &str) -> String {
        format!("<g class=\"series s{}\">{content}</g>\n", self.0)
    }

    /// Returns a short piece of the line with a marker in the middle.
    pub(crate) fn sample(self, x: f64, y: f64, length: f64) -> String {
        self.group(&format!(
            "<polyline points=\"{x:.1},{y:.1} {:.1},{y:.1}\"/>{}",
            x + length,
            self.marker(x + length / 2.0, y)
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::well_formed::assert_well_formed;
    use std::collections::BTreeSet;

    #[test]
    fn eight_markers_differ_and_begin_again() {
        let markers: BTreeSet<String> = (0..Series::COUNT)
            .map(|index| Series::nth(index).marker(1.0, 2.0))
            .collect();
        assert_eq!(markers.len(), 8);
        assert_eq!(Series::nth(11), Series::nth(3));
    }

    #[test]
    fn a_sample_is_a_line_with_one_marker() {
        for index in 0..Series::COUNT {
            let svg = Series::nth(index).sample(0.0, 6.0, 34.0);
            assert_well_formed(&svg);
            assert!(svg.contains(&format!("class=\"series s{index}\"")));
        }
    }
}
