//! Convex hulls of points with a radius.

use nalgebra::{Isometry3, Point3, Vector3};

/// Maximum number of points of a hull.
pub const MAX_POINTS: usize = 72;

/// Convex hull of points, enlarged by a radius in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hull {
    points: [Vector3<f64>; MAX_POINTS],
    count: usize,
    /// Radius, in m.
    pub radius: f64,
}

impl Hull {
    /// Creates a hull.
    ///
    /// # Panics
    /// Panics if there are no points or more than [`MAX_POINTS`].
    pub fn new(points: &[Vector3<f64>], radius: f64) -> Self {
        assert!((1..=MAX_POINTS).contains(&points.len()), "points of a hull");
        let mut hull = Self {
            points: [Vector3::zeros(); MAX_POINTS],
            count: points.len(),
            radius,
        };
        hull.points[..points.len()].copy_from_slice(points);
        hull
    }

    /// Returns the points.
    pub fn points(&self) -> &[Vector3<f64>] {
        &self.points[..self.count]
    }

    /// Returns centre and radius of a bounding sphere.
    pub fn ball(&self) -> (Vector3<f64>, f64) {
        let centre = self.points().iter().sum::<Vector3<f64>>() / self.count as f64;
        let squares = self.points().iter().map(|p| (p - centre).norm_squared());
        let farthest = squares.fold(0.0, f64::max);
        (centre, farthest.sqrt() + self.radius)
    }

    /// Returns the farthest point in a direction.
    pub fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let mut best = (f64::NEG_INFINITY, self.points[0]);
        for point in self.points() {
            let along = point.dot(direction);
            if along > best.0 {
                best = (along, *point);
            }
        }
        best.1
    }

    /// Returns the hull in another frame.
    pub fn moved(&self, to: &Isometry3<f64>) -> Self {
        let mut moved = *self;
        for point in &mut moved.points[..self.count] {
            *point = (to * Point3::from(*point)).coords;
        }
        moved
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn push(&mut self, point: Vector3<f64>) {
        self.points[self.count] = point;
        self.count += 1;
    }
}
