//! Lit ellipsoids with motion blur.

use nalgebra::{Matrix3, Vector3};

use super::optics::{RayRow, Rays};

/// Share of ambient light.
const AMBIENT: f32 = 0.4;
/// Maximum number of samples of an exposure.
const MOST_MOMENTS: usize = 12;
/// Threshold for the squared half chord through the unit sphere, above which a pixel is not at the outline of a
/// person.
const INTERIOR: f32 = 0.3;
/// Positions of the rays in a pixel, in pixels from its centre.
const INSIDE: [[f32; 2]; 4] = [[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]];

/// An ellipsoid with axes parallel to the inertial frame.
#[derive(Debug, Clone)]
pub(super) struct Solid {
    /// Bounding box in pixels: left, right, top, bottom, ends excluded.
    window: [usize; 4],
    pub(super) depth: f64,
    moments: Vec<Moment>,
    /// Smallest half length, in m.
    smallest: f64,
    /// Transformation from the camera frame to the frame in which the ellipsoid is a unit sphere.
    to_sphere: Matrix3<f32>,
    light: Vector3<f32>,
    /// Brightness below and above its centre, in grey levels.
    shades: [f32; 2],
}

/// Position at one time, in the frame in which the ellipsoid is a unit sphere.
#[derive(Debug, Clone, Copy)]
struct Moment {
    centre: Vector3<f32>,
    /// Squared distance minus 1.
    outside: f32,
}

impl Solid {
    /// - `seen`: centre at the start and the end of the exposure in the camera frame (ahead, left, up), in m
    /// - `axes`: half lengths in the inertial frame, in m
    /// - `turn`: rotation from the camera frame to the inertial frame
    /// - `light`: direction of the light in the inertial frame
    /// - `shades`: share of 255 below and above its centre
    pub(super) fn new(
        seen: [Vector3<f64>; 2],
        axes: Vector3<f64>,
        turn: &Matrix3<f64>,
        light: Vector3<f64>,
        shades: [f32; 2],
        rays: &Rays,
    ) -> Option<Self> {
        let largest = axes.max();
        let nearest = seen[0].x.min(seen[1].x) - largest;
        // Next to or around the camera.
        if nearest < 0.05 {
            return None;
        }
        let middle = (seen[0] + seen[1]) * 0.5;
        let place = |p: &Vector3<f64>| [-p.y / p.x, -p.z / p.x];
        let [a, b] = place(&middle);
        let moved = (place(&seen[0])[0] - place(&seen[1])[0])
            .hypot(place(&seen[0])[1] - place(&seen[1])[1]);
        let reach = 1.3 * largest / nearest * (1.0 + a.hypot(b)) + moved + 0.003;
        let window = rays.window([a, b], reach)?;
        // One sample per half pixel of motion.
        let pixels = moved * 1400.0;
        let count = ((2.0 * pixels).ceil() as usize).clamp(1, MOST_MOMENTS);
        let scale = Matrix3::from_diagonal(&axes.map(|axis| 1.0 / axis));
        let to_sphere = scale * turn;
        let moments = (0..count)
            .map(|i| {
                let part = (i as f64 + 0.5) / count as f64;
                let centre = to_sphere * (seen[0] + (seen[1] - seen[0]) * part);
                Moment {
                    centre: centre.cast(),
                    outside: (centre.norm_squared() - 1.0) as f32,
                }
            })
            .collect();
        Some(Self {
            window,
            smallest: axes.min(),
            depth: middle.norm(),
            moments,
            to_sphere: to_sphere.cast(),
            light: light.cast(),
            shades: shades.map(|shade| 255.0 * shade),
        })
    }

    /// Draws over a row of brightness.
    ///
    /// - `focal`: focal length in pixels
    pub(super) fn cover(&self, v: usize, rays: RayRow<'_>, focal: f64, row: &mut [f32]) {
        let [left, right, top, bottom] = self.window;
        if !(top..bottom).contains(&v) {
            return;
        }
        let half = 1.0 / focal as f32;
        // Width of a pixel at the ellipsoid, on the unit sphere.
        let pixel = (self.depth / focal / self.smallest) as f32;
        let samples = (INSIDE.len() * self.moments.len()) as f32;
        let rays = rays.right[left..right].iter().zip(&rays.down[left..right]);
        for (value, (right, down)) in row[left..right].iter_mut().zip(rays) {
            if let Some(brightness) = self.inside(-right, -down) {
                *value = brightness;
                continue;
            }
            if self.misses(-right, -down, pixel) {
                continue;
            }
            let (mut covered, mut brightness) = (0.0, 0.0);
            for inside in INSIDE {
                let ahead =
                    Vector3::new(1.0, -(right + inside[0] * half), -(down + inside[1] * half));
                let ray = self.to_sphere * ahead;
                let length = ray.norm_squared();
                for moment in &self.moments {
                    let along = ray.dot(&moment.centre);
                    let under_root = along * along - length * moment.outside;
                    if under_root < 0.0 {
                        continue;
                    }
                    let distance = (along - under_root.sqrt()) / length;
                    covered += 1.0;
                    brightness += self.shade(&(ray * distance - moment.centre));
                }
            }
            if covered > 0.0 {
                *value = *value * (1.0 - covered / samples) + brightness / samples;
            }
        }
    }

    /// Returns true if a ray passes the ellipsoid by more than `margin` at all times.
    ///
    /// - `margin`: on the unit sphere
    fn misses(&self, left: f32, up: f32, margin: f32) -> bool {
        let ray = self.to_sphere * Vector3::new(1.0, left, up);
        let length = ray.norm_squared();
        self.moments.iter().all(|moment| {
            let along = ray.dot(&moment.centre);
            along * along < length * (moment.outside - margin * (2.0 + margin))
        })
    }

    /// Returns the brightness of a pixel that an ellipsoid at rest covers completely.
    fn inside(&self, left: f32, up: f32) -> Option<f32> {
        let [moment] = self.moments[..] else {
            return None;
        };
        let ray = self.to_sphere * Vector3::new(1.0, left, up);
        let length = ray.norm_squared();
        let along = ray.dot(&moment.centre);
        let under_root = along * along - length * moment.outside;
        // Long chords are far from the outline.
        (under_root > INTERIOR * length).then(|| {
            let distance = (along - under_root.sqrt()) / length;
            self.shade(&(ray * distance - moment.centre))
        })
    }

    /// - `point`: point on the unit sphere
    fn shade(&self, point: &Vector3<f32>) -> f32 {
        let lit = point.dot(&self.light).max(0.0);
        let own = if point.z > 0.25 {
            self.shades[1]
        } else {
            self.shades[0]
        };
        own * (AMBIENT + (1.0 - AMBIENT) * lit)
    }
}
