//! Catch among obstacles, drawn as two sections through the map.

use std::sync::Arc;

use nalgebra::Vector3;
use tactnet_catching::Robot;
use tactnet_catching::map::{DistanceField, Sphere};
use tactnet_catching_world::StandingBox;
use tactnet_plot::figure;

use crate::look::arm_spheres;
use crate::section::{Section, View};
use crate::trace::{Trace, TraceTick};

/// Depth of the sections below the nearest surface, in m.
const BELOW_SURFACE: f64 = 0.03;

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
    pub(super) fn plan_view(&self) -> String {
        let title = format!(
            "The map cut at a height of {:.2} m, from above, with boxes, arms and ball at the catch; the nearest part of an arm keeps \
             {:.0} mm",
            self.nearest.z,
            1e3 * self.clearance
        );
        self.drawn(&View::ABOVE, &title)
    }

    /// Returns a vertical section, seen from the robot's right side.
    pub(super) fn side_view(&self) -> String {
        let aside = self.nearest.y;
        let title = format!(
            "The map cut upright {:.2} m to the {} of the robot's middle, with boxes, arms and ball at the catch",
            aside.abs(),
            if aside >= 0.0 { "left" } else { "right" }
        );
        self.drawn(&View::SIDE, &title)
    }

    fn drawn(&self, view: &View, title: &str) -> String {
        let section = Section {
            field: &self.field,
            boxes: &self.boxes,
            cut: self.nearest,
            spheres: self.spheres.clone(),
            ball: self.ball,
        };
        let (width, height, svg) = section.draw(view);
        figure(width, height, title, &svg)
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

#[cfg(test)]
mod tests {
    use tactnet_catching::map::VoxelGrid;

    use super::*;

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
}
