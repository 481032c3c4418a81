//! Catch among obstacles, drawn as two sections through the map.

use std::fmt::Write;
use std::sync::Arc;

use nalgebra::Vector3;
use tactnet_catching::Robot;
use tactnet_catching::flight::BALL_RADIUS;
use tactnet_catching::map::{DistanceField, Sphere};
use tactnet_catching_world::StandingBox;
use tactnet_plot::{Axes, Axis, HeatMap, Series as Curve, figure};

use crate::look::arm_spheres;
use crate::trace::{Trace, TraceTick};
use tactnet_plot::report::LEFT;

/// Edge length of a drawn cell, in m.
const CELL: f64 = 0.04;
const PIXELS: f64 = 8.0;
/// Drawn range of the map ahead, in m.
const AHEAD: [f64; 2] = [-0.48, 1.52];
const ASIDE: [f64; 2] = [-1.28, 1.28];
const UP: [f64; 2] = [0.4, 2.2];
/// Depth of the sections below the nearest surface, in m.
const BELOW_SURFACE: f64 = 0.03;
/// Distance from obstacles at which the shading ends, in m.
const FAR: f64 = 0.3;

/// State at the time at which a ball is nearest to a hand.
pub(super) struct Scene {
    field: Arc<DistanceField>,
    boxes: Vec<StandingBox>,
    /// Spheres of both arms in the inertial frame.
    spheres: Vec<Sphere>,
    ball: Option<Vector3<f64>>,
    /// Point of the sections, just inside the obstacle of the map that is nearest to a sphere, in m.
    nearest: Vector3<f64>,
    /// Distance of that sphere from the obstacle, in m.
    pub clearance: f64,
    /// Minimum distance of all spheres from the true boxes in m; `None` without boxes.
    pub true_clearance: Option<f64>,
}

impl Scene {
    /// Returns the scene of a throw; `None` if the robot did not look around.
    pub fn of(trace: &Trace, robot: &Robot) -> Option<Self> {
        let field = trace.field.clone()?;
        let tick = catch_tick(trace)?;
        let (place, turn) = &tick.chest;
        let spheres: Vec<Sphere> = arm_spheres(robot, &tick.angles)
            .map(|sphere| Sphere {
                centre: place + turn * sphere.centre,
                ..sphere
            })
            .collect();
        let room = |sphere: &Sphere| field.distance(&sphere.centre) - sphere.radius;
        let nearest = spheres.iter().min_by(|a, b| room(a).total_cmp(&room(b)))?;
        let true_clearance = trace
            .boxes
            .iter()
            .flat_map(|one| {
                let room = |sphere: &Sphere| one.distance(&sphere.centre) - sphere.radius;
                spheres.iter().map(room)
            })
            .min_by(f64::total_cmp);
        Some(Self {
            clearance: room(nearest),
            nearest: towards(&field, &nearest.centre),
            true_clearance,
            ball: tick.balls.iter().flatten().next().copied(),
            boxes: trace.boxes.clone(),
            field,
            spheres,
        })
    }

    /// Returns a horizontal section, seen from above.
    pub fn plan_view(&self) -> String {
        let height = self.nearest.z;
        let axes = axes(
            Axis::linear("to the right of the robot [m]", ASIDE[0]..=ASIDE[1], 0.5),
            Axis::linear("ahead [m]", AHEAD[0]..=AHEAD[1], 0.5),
            [ASIDE, AHEAD],
        );
        let cells = self.cells(&axes, [ASIDE, AHEAD], |right, ahead| {
            Vector3::new(ahead, -right, height)
        });
        let mut over = String::new();
        for one in &self.boxes {
            let corners = corners(one).map(|corner| (-corner.y, corner.x));
            let cut = (one.middle[2] - height).abs() <= 0.5 * one.size[2];
            over += &outline(&axes, &corners, cut);
        }
        over += &self.round(&axes, |p| (-p.y, p.x), |p| (p.z - height).abs());
        let title = format!(
            "The map cut at a height of {height:.2} m, from above, with boxes, arms and ball at the catch; the nearest part of an arm keeps \
             {:.0} mm",
            1e3 * self.clearance
        );
        drawn(&axes, &title, &cells, &over)
    }

    /// Returns a vertical section, seen from the robot's right side.
    pub fn side_view(&self) -> String {
        let aside = self.nearest.y;
        let axes = axes(
            Axis::linear("ahead [m]", AHEAD[0]..=AHEAD[1], 0.5),
            Axis::linear("up [m]", UP[0]..=UP[1], 0.5),
            [AHEAD, UP],
        );
        let cells = self.cells(&axes, [AHEAD, UP], |ahead, up| {
            Vector3::new(ahead, aside, up)
        });
        let mut over = String::new();
        for one in &self.boxes {
            if let Some([from, to]) = chord(one, aside) {
                let [low, high] = [-0.5, 0.5].map(|part| one.middle[2] + part * one.size[2]);
                let corners = [(from, low), (to, low), (to, high), (from, high)];
                over += &outline(&axes, &corners, true);
            }
        }
        over += &self.round(&axes, |p| (p.x, p.z), |p| (p.y - aside).abs());
        let title = format!(
            "The map cut upright {:.2} m to the {} of the robot's middle, with boxes, arms and ball at the catch",
            aside.abs(),
            if aside >= 0.0 { "left" } else { "right" }
        );
        drawn(&axes, &title, &cells, &over)
    }

    /// Draws the cells of a section: darkest inside obstacles, transparent from 30 cm on.
    ///
    /// - `at`: point for a horizontal and a vertical coordinate
    fn cells(
        &self,
        axes: &Axes,
        [across, up]: [[f64; 2]; 2],
        at: impl Fn(f64, f64) -> Vector3<f64>,
    ) -> String {
        let count = |range: [f64; 2]| ((range[1] - range[0]) / CELL).round() as usize;
        let middle = |row: usize, column: usize| {
            at(
                across[0] + (column as f64 + 0.5) * CELL,
                up[1] - (row as f64 + 0.5) * CELL,
            )
        };
        let shares: Vec<Vec<f64>> = (0..count(up))
            .map(|row| {
                (0..count(across))
                    .map(|column| share(self.field.distance(&middle(row, column))))
                    .collect()
            })
            .collect();
        let map = HeatMap {
            left: axes.left,
            top: axes.top,
            cell: PIXELS,
        };
        map.draw(&shares, |row, column| {
            let distance = self.field.distance(&middle(row, column));
            if distance <= 0.0 {
                "inside an obstacle, or behind its surface".into()
            } else {
                format!("{:.0} cm from an obstacle", 100.0 * distance)
            }
        })
    }

    /// Draws spheres and ball, darker if they intersect the section.
    fn round(
        &self,
        axes: &Axes,
        onto: impl Fn(&Vector3<f64>) -> (f64, f64),
        from_cut: impl Fn(&Vector3<f64>) -> f64,
    ) -> String {
        let circle = |centre: &Vector3<f64>, radius: f64| {
            let (x, y) = onto(centre);
            let opacity = [0.25, 0.75][usize::from(from_cut(centre) < radius)];
            format!(
                "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"{:.1}\" opacity=\"{opacity}\"/>",
                axes.x(x),
                axes.y(y),
                radius * PIXELS / CELL
            )
        };
        let spheres = self.spheres.iter();
        let arms: String = spheres.map(|one| circle(&one.centre, one.radius)).collect();
        let ball = self.ball.map(|place| circle(&place, BALL_RADIUS));
        Curve::nth(1).group(&arms) + &Curve::nth(0).group(&ball.unwrap_or_default())
    }
}

/// Returns a point just inside the obstacle nearest to a place, or the place itself if the map has none.
fn towards(field: &DistanceField, place: &Vector3<f64>) -> Vector3<f64> {
    let (distance, slope) = field.gradient(place);
    slope.try_normalize(1e-6).map_or(*place, |away| {
        place - away * (distance.max(0.0) + BELOW_SURFACE)
    })
}

/// Returns the tick at which a ball is nearest to a hand.
fn catch_tick(trace: &Trace) -> Option<&TraceTick> {
    let apart = |tick: &TraceTick| {
        let balls = tick.balls.iter().flatten();
        balls
            .flat_map(|ball| tick.hands.iter().map(move |hand| (hand - ball).norm()))
            .fold(f64::INFINITY, f64::min)
    };
    trace
        .ticks
        .iter()
        .min_by(|a, b| apart(a).total_cmp(&apart(b)))
}

/// Returns the heat map's value for an opacity that fades linearly with the distance.
fn share(distance: f64) -> f64 {
    let opacity: f64 = match distance {
        inside if inside <= 0.0 => 1.0,
        outside => 0.7 * (1.0 - outside / FAR),
    };
    // Inverse of the heat map's exponent.
    if opacity < 0.12 {
        0.0
    } else {
        opacity.powf(2.5)
    }
}

fn axes(horizontal: Axis, vertical: Axis, [across, up]: [[f64; 2]; 2]) -> Axes {
    Axes {
        left: LEFT,
        top: 12.0,
        width: (across[1] - across[0]) / CELL * PIXELS,
        height: (up[1] - up[0]) / CELL * PIXELS,
        horizontal,
        vertical,
    }
}

/// Returns the corners of a box from above, in m.
fn corners(one: &StandingBox) -> [Vector3<f64>; 4] {
    let (sin, cos) = one.turn.sin_cos();
    [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(a, b)| {
        let (u, v) = (0.5 * a * one.size[0], 0.5 * b * one.size[1]);
        Vector3::from(one.middle) + Vector3::new(cos * u - sin * v, sin * u + cos * v, 0.0)
    })
}

/// Returns the range along x that a box covers at `aside` m to the left, or `None`.
fn chord(one: &StandingBox, aside: f64) -> Option<[f64; 2]> {
    let (sin, cos) = one.turn.sin_cos();
    let y = aside - one.middle[1];
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    // In the axes of the box, the line is `offset + slope x`.
    for (offset, slope, half) in [
        (sin * y, cos, 0.5 * one.size[0]),
        (cos * y, -sin, 0.5 * one.size[1]),
    ] {
        if slope.abs() < 1e-12 {
            if offset.abs() > half {
                return None;
            }
            continue;
        }
        let (a, b) = ((-half - offset) / slope, (half - offset) / slope);
        range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
    }
    (range[0] < range[1]).then(|| range.map(|x| one.middle[0] + x))
}

/// Draws a closed line; faint if the section does not intersect it.
fn outline(axes: &Axes, corners: &[(f64, f64)], cut: bool) -> String {
    let mut closed = corners.to_vec();
    closed.extend(corners.first());
    let line = axes.path(Curve::nth(2), &closed);
    if cut {
        line
    } else {
        format!("<g class=\"faint\">{line}</g>")
    }
}

/// Draws the axes with cells; content above the cells is clipped to the axes.
fn drawn(axes: &Axes, title: &str, cells: &str, over: &str) -> String {
    let Axes {
        left,
        top,
        width,
        height,
        ..
    } = axes;
    let mut svg = String::from(cells);
    svg += &axes.grid();
    let _ = write!(
        svg,
        "<svg x=\"{left:.0}\" y=\"{top:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" viewBox=\"{left:.0} {top:.0} {width:.0} {height:.0}\">{over}</svg>"
    );
    figure(left + width + 16.0, top + height + 48.0, title, &svg)
}

#[cfg(test)]
mod tests {
    use tactnet_catching::map::VoxelGrid;
    use tactnet_catching_world::{BoxConfig, ObstaclesConfig, World, WorldConfig};

    use super::*;

    fn standing(turn: f64) -> StandingBox {
        let config = WorldConfig {
            obstacles: ObstaclesConfig {
                boxes: vec![BoxConfig {
                    turn,
                    ..BoxConfig::fixed([2.0, 0.3, 0.5], [0.4, 0.2, 1.0])
                }],
            },
            ..WorldConfig::default()
        };
        let robot = Robot::nominal();
        let world = World::new(robot.description(), &config, 1, &robot.waiting()).unwrap();
        world.boxes()[0]
    }

    #[test]
    fn outlines_lie_on_the_surfaces_of_boxes() {
        for turn in [0.0, 0.6, -1.2] {
            let one = standing(turn);
            for corner in corners(&one) {
                assert!(one.distance(&corner).abs() < 1e-9, "{turn}: {corner}");
            }
            for aside in [0.25, 0.3, 0.34] {
                for end in chord(&one, aside).unwrap() {
                    let distance = one.distance(&Vector3::new(end, aside, 0.5));
                    assert!(distance.abs() < 1e-9, "{turn}, {aside}: {distance}");
                }
            }
            assert_eq!(chord(&one, 1.0), None);
        }
    }

    #[test]
    fn cuts_go_through_the_nearest_obstacle() {
        let grid = VoxelGrid::default();
        let mut solid = vec![false; grid.count()];
        let cell = grid.cell_at(&Vector3::new(0.5, 0.6, 1.0)).unwrap();
        // A block of 12 cm.
        for x in cell[0]..cell[0] + 6 {
            for y in cell[1]..cell[1] + 6 {
                for z in cell[2]..cell[2] + 6 {
                    solid[grid.number([x, y, z])] = true;
                }
            }
        }
        let field = DistanceField::new(grid, &solid);
        let place = Vector3::new(0.55, 0.1, 1.05);
        let point = towards(&field, &place);
        let below = field.distance(&point) + BELOW_SURFACE;
        assert!(below.abs() < 0.01, "{point}");
        let off = (point - Vector3::new(0.55, 0.63, 1.05)).norm();
        assert!(off < 0.04, "{point}");
        let empty = DistanceField::empty(VoxelGrid::default());
        assert_eq!(towards(&empty, &place), place);
    }

    #[test]
    fn shades_fade_with_the_distance() {
        let shades = [-0.1, 0.0, 0.05, 0.15, 0.3].map(|d| tactnet_plot::shade(share(d)));
        assert_eq!(shades[0], 1.0);
        assert!(shades.is_sorted_by(|a, b| a >= b), "{shades:?}");
        assert!((shades[3] - 0.35).abs() < 1e-9 && share(0.3) == 0.0);
    }
}
