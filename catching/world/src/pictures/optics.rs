//! Rays through pixels.

use tactnet_catching_packets::Cameras;

use crate::planted::CameraErrors;

/// Maximum number of fixed-point iterations for the undistortion; each reduces the error about tenfold.
const STEPS: usize = 12;

/// Rays through the pixel centres, in focal lengths to the right and below the optical axis.
#[derive(Debug, Clone)]
pub(super) struct Rays {
    width: usize,
    height: usize,
    right: Vec<f32>,
    down: Vec<f32>,
    optics: Cameras,
    errors: CameraErrors,
}

/// Rays of one row of pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct RayRow<'a> {
    pub(super) right: &'a [f32],
    pub(super) down: &'a [f32],
}

impl Rays {
    pub(super) fn new(optics: &Cameras, errors: &CameraErrors) -> Self {
        let (width, height) = (optics.width as usize, optics.height as usize);
        let mut right = Vec::with_capacity(width * height);
        let mut down = Vec::with_capacity(width * height);
        for v in 0..height {
            for u in 0..width {
                let [a, b] = ray(optics, errors, [u as f64 + 0.5, v as f64 + 0.5]);
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
            errors: *errors,
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
        let mut least = [f64::INFINITY; 2];
        let mut most = [f64::NEG_INFINITY; 2];
        for corner in 0..9 {
            let [i, j] = [corner / 3, corner % 3].map(|step| reach * f64::from(step - 1));
            let seen = self.place([a + i, b + j]);
            for i in 0..2 {
                least[i] = least[i].min(seen[i]);
                most[i] = most[i].max(seen[i]);
            }
        }
        let of = |x: f64, size: usize| x.clamp(0.0, size as f64) as usize;
        let window = [
            of(least[0], self.width),
            of(most[0].ceil(), self.width),
            of(least[1], self.height),
            of(most[1].ceil(), self.height),
        ];
        (window[0] < window[1] && window[2] < window[3]).then_some(window)
    }

    /// Returns the place of a ray, in pixels.
    fn place(&self, ray: [f64; 2]) -> [f64; 2] {
        let (optics, errors) = (&self.optics, &self.errors);
        let seen = distorted(errors.distortion, ray);
        let scale = (optics.focal + errors.focal) / optics.focal;
        let seen = [0, 1].map(|i| seen[i] * scale + errors.centre[i] / optics.focal);
        let seen = distorted(optics.distortion, seen);
        let size = [self.width, self.height];
        [0, 1].map(|i| seen[i] * optics.focal + size[i] as f64 / 2.0)
    }
}

/// Returns the ray through a place in pixels, which the lens of the description and that of the planted errors bend.
fn ray(optics: &Cameras, errors: &CameraErrors, place: [f64; 2]) -> [f64; 2] {
    let size = [optics.width, optics.height].map(f64::from);
    let seen = [0, 1].map(|i| (place[i] - size[i] / 2.0) / optics.focal);
    let seen = undistorted(optics.distortion, seen);
    let scale = optics.focal / (optics.focal + errors.focal);
    let seen = [0, 1].map(|i| (seen[i] - errors.centre[i] / optics.focal) * scale);
    undistorted(errors.distortion, seen)
}

fn stretch([k1, k2]: [f64; 2], [a, b]: [f64; 2]) -> f64 {
    let s = a * a + b * b;
    1.0 + s * (k1 + s * k2)
}

fn distorted(distortion: [f64; 2], ray: [f64; 2]) -> [f64; 2] {
    let factor = stretch(distortion, ray);
    ray.map(|x| x * factor)
}

fn undistorted(distortion: [f64; 2], seen: [f64; 2]) -> [f64; 2] {
    let mut ray = seen;
    for _ in 0..STEPS {
        let factor = stretch(distortion, ray);
        let next = seen.map(|x| x / factor);
        if next == ray {
            break;
        }
        ray = next;
    }
    ray
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planted::PlantedErrors;
    use tactnet_catching_packets::RobotDescription;

    #[test]
    fn rays_fall_on_the_pixels_that_they_go_through() {
        let mut optics = RobotDescription::nominal().cameras;
        optics.distortion = [-0.08, 0.02];
        let errors = |planted: PlantedErrors| planted.each_camera(0)[0];
        for errors in [PlantedErrors::default(), PlantedErrors::uncalibrated(3)].map(errors) {
            let rays = Rays::new(&optics, &errors);
            for (u, v) in [(0, 0), (800, 625), (1599, 1249), (1234, 56)] {
                let row = rays.row(v);
                let ray = [f64::from(row.right[u]), f64::from(row.down[u])];
                let seen = rays.place(ray);
                assert!((seen[0] - u as f64 - 0.5).abs() < 1e-3);
                assert!((seen[1] - v as f64 - 0.5).abs() < 1e-3);
            }
        }
        let rays = Rays::new(&optics, &errors(PlantedErrors::default()));
        let middle = rays.window([0.0, 0.0], 0.01).unwrap();
        assert_eq!(middle, [786, 814, 611, 639]);
        assert_eq!(rays.window([2.0, 0.0], 0.01), None);
    }
}
