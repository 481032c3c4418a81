//! Lit ellipsoids, as they move while the shutter is open.

use nalgebra::{Matrix3, Vector3};

use super::optics::{RayRow, Rays};

/// Light from everywhere, share.
const AMBIENT: f32 = 0.4;
/// Most moments of an exposure that are drawn.
const MOST_MOMENTS: usize = 12;
/// A ray this deep inside, as the square of half its way through the unit sphere, is no pixel away from the outline of a person.
const INTERIOR: f32 = 0.3;
/// Where rays go through a pixel, in pixels from its middle.
const INSIDE: [[f32; 2]; 4] = [[-0.25, -0.25], [0.25, -0.25], [-0.25, 0.25], [0.25, 0.25]];

/// An ellipsoid whose axes are those of the inertial frame.
#[derive(Debug, Clone)]
pub(super) struct Solid {
    /// Pixels that it may cover: left, right, top, bottom, ends excluded.
    window: [usize; 4],
    depth: f64,
    moments: Vec<Moment>,
    /// From the camera's directions to those in which it is a unit sphere.
    to_sphere: Matrix3<f32>,
    light: Vector3<f32>,
    /// Brightness below and above its middle, digits.
    shades: [f32; 2],
}

/// Where it is at one moment, in the directions in which it is a unit sphere.
#[derive(Debug, Clone, Copy)]
struct Moment {
    centre: Vector3<f32>,
    /// Squared distance, less 1.
    outside: f32,
}

impl Solid {
    /// - `seen`: its centre when the shutter opens and when it closes, camera's directions (ahead, left, up), m
    /// - `axes`: half lengths, inertial frame, m
    /// - `turn`: from the camera's directions to the inertial frame's
    /// - `light`: from where, inertial frame
    /// - `shades`: share of 255 below and above its middle
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
        // Beside or around the camera.
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
        // A moment for every half pixel of motion.
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
            depth: middle.norm(),
            moments,
            to_sphere: to_sphere.cast(),
            light: light.cast(),
            shades: shades.map(|shade| 255.0 * shade),
        })
    }

    pub(super) fn depth(&self) -> f64 {
        self.depth
    }

    /// Draws over a row of brightness.
    ///
    /// - `focal`: pixels
    pub(super) fn cover(&self, v: usize, rays: RayRow<'_>, focal: f64, row: &mut [f32]) {
        let [left, right, top, bottom] = self.window;
        if !(top..bottom).contains(&v) {
            return;
        }
        let half = 1.0 / focal as f32;
        let samples = (INSIDE.len() * self.moments.len()) as f32;
        let rays = rays.right[left..right].iter().zip(&rays.down[left..right]);
        for (value, (right, down)) in row[left..right].iter_mut().zip(rays) {
            if let Some(brightness) = self.inside(-right, -down) {
                *value = brightness;
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

    /// Brightness of a pixel that all of it covers all the time, where nothing moves.
    fn inside(&self, left: f32, up: f32) -> Option<f32> {
        let [moment] = self.moments[..] else {
            return None;
        };
        let ray = self.to_sphere * Vector3::new(1.0, left, up);
        let length = ray.norm_squared();
        let along = ray.dot(&moment.centre);
        let under_root = along * along - length * moment.outside;
        // Far from the outline: where the ray is long inside.
        (under_root > INTERIOR * length).then(|| {
            let distance = (along - under_root.sqrt()) / length;
            self.shade(&(ray * distance - moment.centre))
        })
    }

    /// - `point`: of the unit sphere
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
