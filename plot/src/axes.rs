//! Rectangles with two axes.

use crate::{Axis, Series, escape};

/// Rectangle with two axes. Labels need 52 units on the left and 40 below.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes {
    /// Left edge, user units.
    pub left: f64,
    /// Upper edge, user units.
    pub top: f64,
    /// Width, user units.
    pub width: f64,
    /// Height, user units.
    pub height: f64,
    /// Axis from left to right.
    pub horizontal: Axis,
    /// Axis from the bottom to the top.
    pub vertical: Axis,
}

impl Axes {
    /// Returns the horizontal position of a value; not finite if the scale cannot show it.
    pub fn x(&self, value: f64) -> f64 {
        self.left + self.width * self.horizontal.scale.share(value)
    }

    /// Returns the vertical position of a value; not finite if the scale cannot show it.
    pub fn y(&self, value: f64) -> f64 {
        self.top + self.height * (1.0 - self.vertical.scale.share(value))
    }

    /// Returns the grid with the labels of both axes.
    pub fn grid(&self) -> String {
        let (right, bottom) = (self.left + self.width, self.top + self.height);
        let mut svg = String::new();
        for tick in &self.vertical.ticks {
            let y = self.y(tick.value);
            if y.is_finite() {
                svg.push_str(&format!(
                    "<line class=\"grid\" x1=\"{:.1}\" x2=\"{right:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
                     <text class=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
                    self.left,
                    self.left - 6.0,
                    y + 4.0,
                    escape(&tick.label)
                ));
            }
        }
        svg.push_str(&format!(
            "<text class=\"middle label\" transform=\"translate({:.1} {:.1}) rotate(-90)\">{}</text>\n",
            self.left - 40.0,
            self.top + self.height / 2.0,
            escape(&self.vertical.label)
        ));
        for tick in &self.horizontal.ticks {
            let x = self.x(tick.value);
            if x.is_finite() {
                svg.push_str(&format!(
                    "<line class=\"grid\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{bottom:.1}\"/>\
                     <text class=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>\n",
                    self.top,
                    bottom + 16.0,
                    escape(&tick.label)
                ));
            }
        }
        svg.push_str(&format!(
            "<text class=\"middle label\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n",
            self.left + self.width / 2.0,
            bottom + 34.0,
            escape(&self.horizontal.label)
        ));
        svg
    }

    /// Returns a line through `points` with a marker on every `marker_every`-th point.
    ///
    /// - `points`: `(x, y)` in the units of the axes, in drawing order; points that the scales cannot show are omitted
    /// - `marker_every`: 0 and 1 mark every point
    pub fn line(&self, series: Series, points: &[(f64, f64)], marker_every: usize) -> String {
        let places = self.places(points);
        let markers: String = places
            .iter()
            .step_by(marker_every.max(1))
            .map(|&(x, y)| series.marker(x, y))
            .collect();
        series.group(&format!(
            "<polyline points=\"{}\"/>{markers}",
            joined(&places)
        ))
    }

    /// Returns a line through `points` without markers.
    ///
    /// - `points`: as in [`line`](Self::line)
    pub fn path(&self, series: Series, points: &[(f64, f64)]) -> String {
        let places = self.places(points);
        series.group(&format!("<polyline points=\"{}\"/>", joined(&places)))
    }

    /// Returns the positions of the points that the scales can show.
    fn places(&self, points: &[(f64, f64)]) -> Vec<(f64, f64)> {
        points
            .iter()
            .map(|&(x, y)| (self.x(x), self.y(y)))
            .filter(|(x, y)| x.is_finite() && y.is_finite())
            .collect()
    }

    /// Returns a vertical bar for each interval.
    ///
    /// - `intervals`: `(x, lower y, upper y)` in the units of the axes; those that the scales cannot show are omitted
    pub fn intervals(&self, series: Series, intervals: &[(f64, f64, f64)]) -> String {
        let bars: String = intervals
            .iter()
            .map(|&(x, low, high)| (self.x(x), self.y(low), self.y(high)))
            .filter(|(x, low, high)| x.is_finite() && low.is_finite() && high.is_finite())
            .map(|(x, low, high)| {
                format!(
                    "<line class=\"range\" x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{low:.1}\" y2=\"{high:.1}\"/>"
                )
            })
            .collect();
        series.group(&bars)
    }
}

/// Returns positions in the syntax of a polyline.
fn joined(places: &[(f64, f64)]) -> String {
    let places: Vec<String> = places
        .iter()
        .map(|(x, y)| format!("{x:.1},{y:.1}"))
        .collect();
    places.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::well_formed::assert_well_formed;

    fn axes() -> Axes {
        Axes {
            left: 50.0,
            top: 10.0,
            width: 400.0,
            height: 200.0,
            horizontal: Axis::decades("a < b [µs]", [1.0, 100.0]).unwrap(),
            vertical: Axis::percent("share, %", 0.5, 0.25),
        }
    }

    #[test]
    fn values_lie_between_the_edges() {
        let axes = axes();
        assert_eq!([1.0, 10.0, 100.0].map(|x| axes.x(x)), [50.0, 250.0, 450.0]);
        assert_eq!([0.0, 0.25, 0.5].map(|y| axes.y(y)), [210.0, 110.0, 10.0]);
    }

    #[test]
    fn the_grid_has_a_line_and_a_label_for_every_tick() {
        let svg = axes().grid();
        assert_well_formed(&svg);
        assert_eq!(svg.matches("class=\"grid\"").count(), 3 + 3);
        assert!(svg.contains("a &lt; b [µs]"));
    }

    #[test]
    fn points_without_a_place_are_left_out() {
        let points = [(0.0, 0.1), (1.0, 0.0), (10.0, f64::NAN), (100.0, 0.5)];
        let svg = axes().line(Series::nth(0), &points, 1);
        assert_well_formed(&svg);
        assert!(svg.contains("points=\"50.0,210.0 450.0,10.0\""), "{svg}");
        assert_eq!(svg.matches("<circle").count(), 2);
        let path = axes().path(Series::nth(0), &points);
        assert_well_formed(&path);
        assert!(path.contains("points=\"50.0,210.0 450.0,10.0\"") && !path.contains("<circle"));
    }

    #[test]
    fn markers_are_as_sparse_as_asked_for() {
        let points: Vec<(f64, f64)> = (1..=9).map(|k| (f64::from(k), 0.1)).collect();
        assert_eq!(
            axes()
                .line(Series::nth(0), &points, 4)
                .matches("<circle")
                .count(),
            3
        );
        assert_eq!(
            axes()
                .line(Series::nth(0), &points, 0)
                .matches("<circle")
                .count(),
            9
        );
    }

    #[test]
    fn intervals_reach_from_end_to_end() {
        let svg = axes().intervals(Series::nth(2), &[(10.0, 0.0, 0.5), (0.0, 0.1, 0.2)]);
        assert_well_formed(&svg);
        assert_eq!(svg.matches("<line").count(), 1);
        assert!(svg.contains("y1=\"210.0\" y2=\"10.0\""), "{svg}");
    }
}
