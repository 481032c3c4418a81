//! Line charts with two logarithmic axes.

use tactnet_plot::{Axes, Axis, Series, key, text_width};

/// One line of a chart.
pub(super) struct Line {
    pub(super) name: String,
    /// `(x, y)`, both positive, ascending in x.
    pub(super) points: Vec<(f64, f64)>,
    /// `(x, minimum y, maximum y)`; may be empty.
    pub(super) bars: Vec<(f64, f64, f64)>,
}

/// A drawn chart.
pub(super) struct Chart {
    pub(super) title: String,
    /// User units.
    pub(super) width: f64,
    /// User units.
    pub(super) height: f64,
    /// SVG elements.
    pub(super) content: String,
}

/// Returns a chart with a legend; `None` for fewer than two values of x.
pub(super) fn log_log(x_name: &str, y_name: &str, lines: &[Line]) -> Option<Chart> {
    let points = || lines.iter().flat_map(|line| &line.points);
    let first = points().next()?;
    if points().all(|point| point.0 == first.0) {
        return None;
    }
    let bars = lines.iter().flat_map(|line| &line.bars);
    let heights = points()
        .map(|point| point.1)
        .chain(bars.flat_map(|bar| [bar.1, bar.2]));
    let axes = Axes {
        left: 52.0,
        top: 12.0,
        width: 380.0,
        height: 284.0,
        horizontal: Axis::decades(x_name, points().map(|point| point.0))?,
        vertical: Axis::decades(y_name, heights)?,
    };
    let mut content = axes.grid();
    for (index, line) in lines.iter().enumerate() {
        let series = Series::nth(index);
        content.push_str(&axes.intervals(series, &line.bars));
        content.push_str(&axes.line(series, &line.points, 1));
    }
    let names: Vec<&str> = lines.iter().map(|line| line.name.as_str()).collect();
    let key_left = axes.left + axes.width + 14.0;
    content.push_str(&key(&names, key_left, axes.top));
    Some(Chart {
        title: format!("{y_name} over {x_name}"),
        width: key_left + 46.0 + 1.2 * text_width(&names),
        height: 340.0,
        content,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(points: &[(f64, f64)]) -> Line {
        Line {
            name: "tactnet".into(),
            points: points.to_vec(),
            bars: points.iter().map(|&(x, y)| (x, y / 2.0, 2.0 * y)).collect(),
        }
    }

    #[test]
    fn a_chart_has_its_lines_bars_and_names() {
        let lines = [line(&[(1.0, 3.0), (64.0, 90.0)]), line(&[(1.0, 5.0)])];
        let chart = log_log("clients C", "round trip [µs]", &lines).unwrap();
        assert_eq!(chart.title, "round trip [µs] over clients C");
        let svg = chart.content;
        assert_eq!(svg.matches("class=\"range\"").count(), 3);
        assert_eq!(svg.matches(">tactnet</text>").count(), 2);
        // Both axes have the decades 1, 10 and 100; a bar ends at 180.
        assert_eq!(svg.matches(">100</text>").count(), 2);
        assert_eq!(svg.matches(">1000</text>").count(), 1);
    }

    #[test]
    fn one_value_of_x_makes_no_chart() {
        assert!(log_log("x", "y", &[line(&[(4.0, 1.0)]), line(&[(4.0, 2.0)])]).is_none());
        assert!(log_log("x", "y", &[]).is_none());
    }
}
