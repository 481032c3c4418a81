//! Legends of series.

use crate::{Series, escape};

/// Returns the legend of the series from the first on as an HTML list, to be placed below a figure.
pub fn legend<S: AsRef<str>>(names: &[S]) -> String {
    let entries: String = names
        .iter()
        .enumerate()
        .map(|(index, name)| {
            format!(
                "<li><svg class=\"key\" aria-hidden=\"true\" width=\"34\" height=\"12\">{}</svg> {}</li>",
                Series::nth(index).sample(0.0, 6.0, 34.0).trim_end(),
                escape(name.as_ref())
            )
        })
        .collect();
    format!("<ul class=\"legend\">{entries}</ul>\n")
}

/// Returns the legend of the series from the first on as SVG, one below the other, to be placed inside a figure.
///
/// - `left`, `top`: upper left corner; each series takes 20 units of height, its sample 34 of width
pub fn key<S: AsRef<str>>(names: &[S], left: f64, top: f64) -> String {
    names
        .iter()
        .enumerate()
        .map(|(index, name)| {
            let y = top + 10.0 + 20.0 * index as f64;
            format!(
                "{}<text x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
                Series::nth(index).sample(left, y, 34.0),
                left + 42.0,
                y + 4.0,
                escape(name.as_ref())
            )
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::well_formed::assert_well_formed;

    #[test]
    fn every_name_stands_beside_its_series() {
        for drawn in [legend(&["a", "<b>"]), key(&["a", "<b>"], 10.0, 10.0)] {
            assert_well_formed(&drawn);
            assert!(drawn.contains("series s0") && drawn.contains("series s1"));
            assert!(drawn.contains("&lt;b&gt;"));
        }
    }
}
