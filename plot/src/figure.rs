//! Frames of figures.

use crate::escape;
use crate::theme::plain_style;

/// Returns a figure for a page whose style sheet contains [`theme`](crate::theme) and [`STYLE`](crate::STYLE). It shrinks
/// with the page.
///
/// - `width`, `height`: user units, pixels at full size
/// - `title`: text for screen readers, not escaped
/// - `content`: SVG elements
pub fn figure(width: f64, height: f64, title: &str, content: &str) -> String {
    format!(
        "<svg class=\"figure\" role=\"img\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\"><title>{}</title>\n{content}</svg>\n",
        escape(title)
    )
}

/// Returns a figure as a separate file with its style and a light background. It loads no other files.
///
/// The parameters are those of [`figure`].
pub fn stand_alone(width: f64, height: f64, title: &str, content: &str) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
         height=\"{height:.0}\">\n<title>{}</title>\n<style>\n{}</style>\n<rect class=\"paper\" width=\"100%\" \
         height=\"100%\"/>\n{content}</svg>\n",
        escape(title),
        plain_style()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::well_formed::assert_well_formed;

    #[test]
    fn a_figure_is_titled_and_closed() {
        for svg in [
            figure(10.0, 20.0, "a & b", "<g/>"),
            stand_alone(10.0, 20.0, "a & b", "<g/>"),
        ] {
            assert_well_formed(&svg);
            assert!(
                svg.contains("<title>a &amp; b</title>") && svg.contains("viewBox=\"0 0 10 20\"")
            );
        }
    }

    #[test]
    fn a_file_of_its_own_needs_nothing_else() {
        let svg = stand_alone(10.0, 20.0, "t", "");
        assert!(svg.contains(".s0 { color: #14588c; }"));
        for reference in ["var(", "url(", "@import", "href"] {
            assert!(!svg.contains(reference), "{reference}");
        }
    }
}
