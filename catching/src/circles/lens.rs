//! Removes the lens distortion from circles.

use tactnet_catching_packets::Cameras;
use tactnet_catching_packets::packets::Circle;

/// Number of fixed-point iterations that undo the distortion. Each reduces the error about tenfold.
const STEPS: usize = 12;

/// Lens distortion of the cameras.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lens {
    focal: f64,
    middle: [f64; 2],
    distortion: [f64; 2],
}

impl Lens {
    pub(super) fn new(cameras: &Cameras) -> Self {
        Self {
            focal: cameras.focal,
            middle: [cameras.width, cameras.height].map(|size| f64::from(size) / 2.0),
            distortion: cameras.distortion,
        }
    }

    /// Returns the distorted position of an undistorted one, in pixels.
    pub(super) fn distorted(&self, place: [f64; 2]) -> [f64; 2] {
        let ray = self.ray_of(place);
        let factor = self.factor(ray);
        self.place_of(ray.map(|x| x * factor))
    }

    /// Returns the undistorted circle, computed from the end points of its horizontal and vertical diameter.
    pub(super) fn undistorted(&self, circle: &Circle) -> Circle {
        let Circle { u, v, r, response } = *circle;
        let ends = [[u - r, v], [u + r, v], [u, v - r], [u, v + r]].map(|end| self.undone(end));
        Circle {
            u: ends.iter().map(|end| end[0]).sum::<f64>() / 4.0,
            v: ends.iter().map(|end| end[1]).sum::<f64>() / 4.0,
            r: (ends[1][0] - ends[0][0] + ends[3][1] - ends[2][1]) / 4.0,
            response,
        }
    }

    fn undone(&self, place: [f64; 2]) -> [f64; 2] {
        let seen = self.ray_of(place);
        let mut ray = seen;
        for _ in 0..STEPS {
            let factor = self.factor(ray);
            ray = seen.map(|x| x / factor);
        }
        self.place_of(ray)
    }

    fn factor(&self, [a, b]: [f64; 2]) -> f64 {
        let s = a * a + b * b;
        1.0 + s * (self.distortion[0] + s * self.distortion[1])
    }

    fn ray_of(&self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| (place[i] - self.middle[i]) / self.focal)
    }

    fn place_of(self, ray: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|i| ray[i] * self.focal + self.middle[i])
    }
}
