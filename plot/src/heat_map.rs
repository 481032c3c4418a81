//! Heat maps of a matrix of shares.

use crate::escape;

/// Position of a heat map with square cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeatMap {
    /// Left edge, user units.
    pub left: f64,
    /// Upper edge, user units.
    pub top: f64,
    /// Width and height of a cell, user units.
    pub cell: f64,
}

impl HeatMap {
    /// Returns the cells with shares above 0 on their background, each with a tooltip.
    ///
    /// - `shares`: `[rows][columns]`, 0 to 1
    /// - `describe`: tooltip of a row and a column
    pub fn draw(&self, shares: &[Vec<f64>], describe: impl Fn(usize, usize) -> String) -> String {
        let Self { left, top, cell } = self;
        let mut svg = format!(
            "<rect class=\"ground\" x=\"{left:.1}\" y=\"{top:.1}\" width=\"{}\" height=\"{}\"/>\n<g class=\"heat\">\n",
            cell * shares.first().map_or(0, Vec::len) as f64,
            cell * shares.len() as f64,
        );
        for (row, shares) in shares.iter().enumerate() {
            for (column, &share) in shares.iter().enumerate() {
                if share > 0.0 {
                    svg.push_str(&format!(
                        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{cell}\" height=\"{cell}\" fill-opacity=\"{:.2}\">\
                         <title>{}</title></rect>\n",
                        left + cell * column as f64,
                        top + cell * row as f64,
                        shade(share),
                        escape(&describe(row, column))
                    ));
                }
            }
        }
        svg.push_str("</g>\n");
        svg
    }
}

/// Returns the opacity of a share's cell, 0 to 1. It is a power with an exponent below one, so small shares are visible.
pub fn shade(share: f64) -> f64 {
    share.clamp(0.0, 1.0).powf(0.4).max(0.12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::well_formed::assert_well_formed;

    #[test]
    fn cells_above_zero_are_drawn_in_their_place() {
        let map = HeatMap {
            left: 10.0,
            top: 20.0,
            cell: 5.0,
        };
        let svg = map.draw(&[vec![1.0, 0.0, 0.2]], |row, column| {
            format!("<{row}, {column}>")
        });
        assert_well_formed(&svg);
        assert_eq!(svg.matches("<title>").count(), 2);
        assert!(svg.contains("width=\"15\" height=\"5\""), "{svg}");
        assert!(svg.contains("x=\"20.0\" y=\"20.0\""), "{svg}");
        assert!(svg.contains("&lt;0, 2&gt;"), "{svg}");
    }

    #[test]
    fn shades_deepen_with_the_share() {
        assert!(shade(0.01) < shade(0.05) && shade(0.05) < shade(1.0));
        assert_eq!(shade(1.0), 1.0);
    }
}
