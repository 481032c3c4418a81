//! Projection of a ball: the exact outline of a sphere.
//!
//! For a sphere of radius `R` at distance `d`, `theta` off the optical axis, with `beta = asin(R / d)`, the outline is
//! an ellipse. Its centre is at `f sin 2theta / (cos 2theta + cos 2beta)`, its radial semi-axis is `f sin 2beta / (cos
//! 2theta + cos 2beta)` and its tangential semi-axis `f R / sqrt(z^2 - R^2)`. With `z = d cos theta` the denominators
//! equal `2 (z^2 - R^2) / d^2`, so no angles are needed. The radius of a circle is the mean of both semi-axes.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::Cameras;

use super::head::Head;
use crate::flight::BALL_RADIUS;

/// Number of cameras: left, right.
pub const CAMERAS: usize = 2;

/// Camera in the head that looks along the head's x axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Position in the head frame, in m.
    pub offset: Vector3<f64>,
    /// Focal length, in pixels.
    pub focal: f64,
    /// Width and height of the picture, in pixels.
    pub size: [f64; 2],
}

impl Camera {
    /// Returns the left and the right camera.
    pub fn pair(cameras: &Cameras) -> [Self; CAMERAS] {
        let centre = Vector3::from(cameras.centre);
        std::array::from_fn(|camera| Self {
            offset: centre
                + Vector3::y() * ([0.5, -0.5][camera] * cameras.baseline)
                + Vector3::from(cameras.shifts[camera]),
            focal: cameras.focal,
            size: [f64::from(cameras.width), f64::from(cameras.height)],
        })
    }

    /// Returns the circle (u, v, r), in pixels, of a ball at `ball` in the head frame, in m. Returns `None` unless the
    /// whole ball is in front of the camera.
    pub fn outline(&self, ball: &Vector3<f64>) -> Option<Vector3<f64>> {
        let seen = ball - self.offset;
        let depth = seen.x * seen.x - BALL_RADIUS * BALL_RADIUS;
        if !(seen.x > BALL_RADIUS && depth.is_finite()) {
            return None;
        }
        let scale = self.focal * seen.x / depth;
        let tangential = self.focal * BALL_RADIUS / depth.sqrt();
        let radial = self.focal * BALL_RADIUS / depth
            * (seen.norm_squared() - BALL_RADIUS * BALL_RADIUS).sqrt();
        Some(Vector3::new(
            self.size[0] / 2.0 - scale * seen.y,
            self.size[1] / 2.0 - scale * seen.z,
            (tangential + radial) / 2.0,
        ))
    }

    /// Returns the position of a sphere in the camera frame (forward, left, up) from its outline, the inverse of
    /// [`Camera::outline`] for any radius.
    ///
    /// - `circle`: outline (u, v, r), in pixels
    /// - `radius`: radius of the sphere, in m
    pub fn sphere(&self, circle: &Vector3<f64>, radius: f64) -> Vector3<f64> {
        let [left, up] = [0, 1].map(|i| (self.size[i] / 2.0 - circle[i]) / self.focal);
        let squared = left * left + up * up;
        let mean = circle.z / self.focal;
        // Tangential semi-axis in focal lengths, by fixed-point iteration; each step divides the error by over 40.
        let tangential = (0..8).fold(mean, |axis, _| {
            2.0 * mean / (1.0 + (1.0 + squared / (1.0 + axis * axis)).sqrt())
        });
        let ahead = radius * (1.0 + tangential.powi(-2)).sqrt();
        let side = ahead / (1.0 + tangential * tangential);
        Vector3::new(ahead, left * side, up * side)
    }

    /// Returns the distance of a circle's centre from the picture's edge, in pixels; negative outside.
    pub fn inside(&self, circle: &Vector3<f64>) -> f64 {
        let [width, height] = self.size;
        [circle.x, width - circle.x, circle.y, height - circle.y]
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }
}

/// Camera at the current head pose.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Camera.
    pub camera: Camera,
    /// Rotation from the inertial frame to the head frame.
    to_head: Matrix3<f64>,
    /// Position of the head frame in the inertial frame, in m.
    head: Vector3<f64>,
    velocity: Vector3<f64>,
}

impl View {
    /// Creates the view of a camera from a head pose.
    pub fn new(camera: Camera, head: &Head) -> Self {
        Self {
            camera,
            to_head: head.rotation.transpose(),
            head: head.position,
            velocity: head.velocity,
        }
    }

    /// Returns the circle of a ball at `p` in the inertial frame, in m.
    pub fn see(&self, p: &Vector3<f64>) -> Option<Vector3<f64>> {
        self.camera.outline(&(self.to_head * (p - self.head)))
    }

    /// Returns the motion of a ball's circle in `dt` seconds, in pixels.
    pub fn motion(&self, p: &Vector3<f64>, v: &Vector3<f64>, dt: f64) -> Option<Vector3<f64>> {
        let half = (v - self.velocity) * (dt / 2.0);
        Some(self.see(&(p + half))? - self.see(&(p - half))?)
    }

    /// Returns the vector from the head to a ball, along the inertial axes, in m.
    pub fn from_head(&self, p: &Vector3<f64>) -> Vector3<f64> {
        p - self.head
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;

    fn left() -> Camera {
        Camera::pair(&RobotDescription::nominal().cameras)[0]
    }

    proptest! {
        /// Compares with the formula in angles and with tangent rays at the ends of the radial axis.
        #[test]
        fn outlines_are_those_of_the_angles(x in 0.3..7.0f64, y in -2.0..2.0f64, z in -2.0..2.0f64) {
            let camera = left();
            let seen = Vector3::new(x, y, z);
            let circle = camera.outline(&(seen + camera.offset)).unwrap();
            let theta = y.hypot(z).atan2(x);
            let beta = (BALL_RADIUS / seen.norm()).asin();
            let away = camera.focal * (2.0 * theta).sin() / ((2.0 * theta).cos() + (2.0 * beta).cos());
            let radial = camera.focal * (2.0 * beta).sin() / ((2.0 * theta).cos() + (2.0 * beta).cos());
            let tangential = camera.focal * BALL_RADIUS / (x * x - BALL_RADIUS * BALL_RADIUS).sqrt();
            prop_assert!(((circle.x - 800.0).hypot(circle.y - 625.0) - away).abs() < 1e-6 * (1.0 + away));
            prop_assert!((circle.z - (radial + tangential) / 2.0).abs() < 1e-6 * circle.z);
            // Both ends of the radial axis: tan (theta +- beta).
            let ends = [away + radial, away - radial].map(|u| u / camera.focal);
            prop_assert!((ends[0] - (theta + beta).tan()).abs() < 1e-6 * (1.0 + ends[0].abs()));
            prop_assert!((ends[1] - (theta - beta).tan()).abs() < 1e-6 * (1.0 + ends[1].abs()));
            prop_assert!((camera.sphere(&circle, BALL_RADIUS) - seen).norm() < 1e-6);
        }
    }

    #[test]
    fn left_is_up_to_less_pixels_and_up_is_to_less() {
        let camera = left();
        let circle = camera
            .outline(&(camera.offset + Vector3::new(2.0, 0.5, 0.3)))
            .unwrap();
        assert!(circle.x < 800.0 && circle.y < 625.0);
        assert!(camera.outline(&(camera.offset - Vector3::x())).is_none());
    }
}
