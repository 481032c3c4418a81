//! Sections through a map, with the true boxes, the robot's spheres and a ball.

use std::fmt::Write;

use nalgebra::Vector3;
use tactnet_catching::flight::BALL_RADIUS;
use tactnet_catching::map::{DistanceField, Sphere};
use tactnet_catching_world::StandingBox;
use tactnet_plot::report::LEFT;
use tactnet_plot::{Axes, Axis, Series as Curve};

/// Edge length of a drawn cell, in m.
const CELL: f64 = 0.02;
/// Pixels per metre.
const SCALE: f64 = 200.0;

/// Direction of view: horizontal and vertical axis (0 ahead, 1 left, 2 up), their titles and ranges in m. The horizontal
/// axis points right, against axis 1.
pub(crate) struct View {
    axes: [usize; 2],
    titles: [&'static str; 2],
    ranges: [[f64; 2]; 2],
}

impl View {
    pub const ABOVE: Self = Self {
        axes: [1, 0],
        titles: ["to the right of the robot [m]", "ahead [m]"],
        ranges: [[-1.28, 0.8], [-0.4, 1.4]],
    };
    pub const FRONT: Self = Self {
        axes: [1, 2],
        titles: ["to the right of the robot [m]", "up [m]"],
        ranges: [[-1.28, 0.8], [0.4, 2.2]],
    };
    pub const SIDE: Self = Self {
        axes: [0, 2],
        titles: ["ahead [m]", "up [m]"],
        ranges: [[-0.4, 1.4], [0.4, 2.2]],
    };

    /// Returns the position of a point on the axes, in m.
    fn onto(&self, p: &Vector3<f64>) -> (f64, f64) {
        let [across, up] = self.axes.map(|axis| p[axis]);
        (if self.axes[0] == 1 { -across } else { across }, up)
    }

    /// Returns the outline of a box.
    fn outline(&self, one: &StandingBox) -> Vec<(f64, f64)> {
        let corners = one.corners().map(|corner| self.onto(&corner));
        let closed = [0, 1, 2, 3, 0];
        if self.axes[1] == 0 {
            return closed.map(|i: usize| corners[i]).to_vec();
        }
        let across = corners.map(|(across, _)| across);
        let [left, right] =
            [f64::min, f64::max].map(|most| across.into_iter().reduce(most).unwrap_or(0.0));
        let [low, high] = [-0.5, 0.5].map(|part| one.middle[2] + part * one.size[2]);
        closed
            .map(|i: usize| [(left, low), (right, low), (right, high), (left, high)][i])
            .to_vec()
    }
}

/// Section through a map with everything that is drawn on it.
pub(crate) struct Section<'a> {
    pub field: &'a DistanceField,
    /// True boxes.
    pub boxes: &'a [StandingBox],
    /// Point of the section, in m.
    pub cut: Vector3<f64>,
    pub spheres: Vec<Sphere>,
    /// Centre of the ball, in m.
    pub ball: Option<Vector3<f64>>,
}

impl Section<'_> {
    /// Returns width and height in pixels, and the drawing: solid cells of the map, spheres (darker if they intersect the
    /// section), and boxes (faint if they do not).
    pub fn draw(&self, view: &View) -> (f64, f64, String) {
        let [across, up] = view.ranges;
        let [horizontal, vertical] = [0, 1]
            .map(|i| Axis::linear(view.titles[i], view.ranges[i][0]..=view.ranges[i][1], 0.5));
        let axes = Axes {
            left: LEFT,
            top: 12.0,
            width: (across[1] - across[0]) * SCALE,
            height: (up[1] - up[0]) * SCALE,
            horizontal,
            vertical,
        };
        let depth = 3 - view.axes[0] - view.axes[1];
        let circle = |centre: &Vector3<f64>, radius: f64| {
            let (x, y) = view.onto(centre);
            let opacity =
                [0.12, 0.4][usize::from((centre[depth] - self.cut[depth]).abs() < radius)];
            format!(
                "<circle cx=\"{:.0}\" cy=\"{:.0}\" r=\"{:.0}\" opacity=\"{opacity}\"/>",
                axes.x(x),
                axes.y(y),
                radius * SCALE
            )
        };
        let spheres: String = self
            .spheres
            .iter()
            .map(|one| circle(&one.centre, one.radius))
            .collect();
        let ball = self
            .ball
            .map(|place| circle(&place, BALL_RADIUS))
            .unwrap_or_default();
        let mut svg = self.solid_cells(view, &axes)
            + &Curve::nth(1).group(&spheres)
            + &Curve::nth(0).group(&ball);
        for one in self.boxes {
            let line = axes.path(Curve::nth(2), &view.outline(one));
            let reach = match depth {
                2 => 0.5 * one.size[2],
                _ => one
                    .corners()
                    .iter()
                    .map(|corner| corner[depth] - one.middle[depth])
                    .fold(0.0, f64::max),
            };
            svg += &match (one.middle[depth] - self.cut[depth]).abs() <= reach {
                true => line,
                false => format!("<g class=\"faint\">{line}</g>"),
            };
        }
        let Axes {
            left,
            top,
            width,
            height,
            ..
        } = &axes;
        let clipped = format!(
            "<svg x=\"{left:.0}\" y=\"{top:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"{left:.0} {top:.0} {width:.0} {height:.0}\">{svg}</svg>"
        );
        (
            left + width + 16.0,
            top + height + 48.0,
            axes.grid() + &clipped,
        )
    }

    /// Draws the cells of the section that are solid in the map, runs of a row as one.
    fn solid_cells(&self, view: &View, axes: &Axes) -> String {
        let [across, up] = view.ranges;
        let [columns, rows] = view
            .ranges
            .map(|range| ((range[1] - range[0]) / CELL).round() as usize);
        let is_solid = |row: usize, column: usize| {
            let mut p = self.cut;
            let right = across[0] + (column as f64 + 0.5) * CELL;
            p[view.axes[0]] = if view.axes[0] == 1 { -right } else { right };
            p[view.axes[1]] = up[1] - (row as f64 + 0.5) * CELL;
            self.field.distance(&p) < 0.0
        };
        let mut cells = String::new();
        for row in 0..rows {
            let mut column = 0;
            while column < columns {
                let run = (column..columns)
                    .take_while(|column| is_solid(row, *column))
                    .count();
                if run > 0 {
                    let (x, y) = (
                        axes.x(across[0] + column as f64 * CELL),
                        axes.y(up[1] - row as f64 * CELL),
                    );
                    let [width, height] = [run as f64, 1.0].map(|cells| cells * CELL * SCALE);
                    let _ = write!(
                        cells,
                        "<rect x=\"{x:.0}\" y=\"{y:.0}\" width=\"{width:.0}\" height=\"{height:.0}\"/>"
                    );
                }
                column += run + 1;
            }
        }
        format!(
            "<g opacity=\"0.45\"><title>inside an obstacle, or behind its surface</title>{cells}</g>"
        )
    }
}
