//! Rays through pixels.

use tactnet_catching_packets::Cameras;

/// Number of fixed-point iterations for the undistortion; each reduces the error about tenfold.
const STEPS: usize = 12;

/// Rays through the pixel centres, in focal lengths to the right and below the optical axis.
#[derive(Debug, Clone)]
pub(super) struct Rays {
    width: usize,
    height: usize,
    right: Vec<f32>,
    down: Vec<f32>,
    optics: Cameras,
}

/// Rays of one row of pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayRow<'a> {
    pub(super) right: &'a [f32],
    pub(super) down: &'a [f32],
}

impl Rays {
    pub(super) fn new(optics: &Cameras) -> Self {
        let (width, height) = (optics.width as usize, optics.height as usize);
        let mut right = Vec::with_capacity(width * height);
        let mut down = Vec::with_capacity(width * height);
        for v in 0..height {
            for u in 0..width {
                let [a, b] = undistorted(optics, pixel(optics, [u as f64 + 0.5, v as f64 + 0.5]));
                right.push(a as f32);
                down.push(b as f32);
            }
        }
        Self {
            width,
            height,
            right,
            down,
            optics: *optics,
        }
    }

    pub(super) fn row(&self, v: usize) -> RayRow<'_> {
        let range = v * self.width..(v + 1) * self.width;
        RayRow {
            right: &self.right[range.clone()],
            down: &self.down[range],
        }
    }

    /// Returns the pixels `[left, right, top, bottom]` (ends excluded) whose rays are within `reach` of `(a, b)`, or
    /// `None` if there are none.
    pub(super) fn window(&self, [a, b]: [f64; 2], reach: f64) -> Option<[usize; 4]> {
        let corners = [
            [-1.0, -1.0],
            [1.0, -1.0],
            [-1.0, 1.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [0.0, -1.0],
            [1.0, 0.0],
            [-1.0, 0.0],
        ];
        let mut least = [f64::INFINITY; 2];
        let mut most = [f64::NEG_INFINITY; 2];
        for corner in corners {
            let seen = distorted(&self.optics, [a + reach * corner[0], b + reach * corner[1]]);
            for i in 0..2 {
                least[i] = least[i].min(seen[i]);
                most[i] = most[i].max(seen[i]);
            }
        }
        let focal = self.optics.focal;
        let of = |x: f64, size: usize| (x * focal + size as f64 / 2.0).clamp(0.0, size as f64);
        let window = [
            of(least[0], self.width).floor() as usize,
            of(most[0], self.width).ceil() as usize,
            of(least[1], self.height).floor() as usize,
            of(most[1], self.height).ceil() as usize,
        ];
        (window[0] < window[1] && window[2] < window[3]).then_some(window)
    }
}

/// Converts pixels from the upper left corner to focal lengths from the principal point.
fn pixel(optics: &Cameras, [u, v]: [f64; 2]) -> [f64; 2] {
    [
        (u - f64::from(optics.width) / 2.0) / optics.focal,
        (v - f64::from(optics.height) / 2.0) / optics.focal,
    ]
}

fn distorted(optics: &Cameras, [a, b]: [f64; 2]) -> [f64; 2] {
    let s = a * a + b * b;
    let factor = 1.0 + s * (optics.distortion[0] + s * optics.distortion[1]);
    [a * factor, b * factor]
}

fn undistorted(optics: &Cameras, seen: [f64; 2]) -> [f64; 2] {
    let mut ray = seen;
    for _ in 0..STEPS {
        let s = ray[0] * ray[0] + ray[1] * ray[1];
        let factor = 1.0 + s * (optics.distortion[0] + s * optics.distortion[1]);
        ray = [seen[0] / factor, seen[1] / factor];
    }
    ray
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactnet_catching_packets::RobotDescription;

    #[test]
    fn rays_fall_on_the_pixels_that_they_go_through() {
        let mut optics = RobotDescription::nominal().cameras;
        optics.distortion = [-0.08, 0.02];
        let rays = Rays::new(&optics);
        for (u, v) in [(0, 0), (800, 625), (1599, 1249), (1234, 56)] {
            let row = rays.row(v);
            let seen = distorted(&optics, [f64::from(row.right[u]), f64::from(row.down[u])]);
            assert!((seen[0] * optics.focal + 800.0 - u as f64 - 0.5).abs() < 1e-3);
            assert!((seen[1] * optics.focal + 625.0 - v as f64 - 0.5).abs() < 1e-3);
        }
        let middle = rays.window([0.0, 0.0], 0.01).unwrap();
        assert_eq!(middle, [786, 814, 611, 639]);
        assert_eq!(rays.window([2.0, 0.0], 0.01), None);
    }
}
