//! Gates: regions of the next picture in which balls are expected.

use nalgebra::Matrix3;
use tactnet_catching_packets::Cameras;
use tactnet_catching_packets::packets::{BallPredictions, HeadPose};

use crate::flight::Flight;
use crate::track::{Camera, Head, View};

/// Radius of a gate, in standard deviations of the prediction.
const DEVIATIONS: f64 = 4.0;
/// Additional radius for errors of detector and head pose, in pixels.
const MARGIN: f64 = 8.0;
/// Maximum radius of a gate, in pixels.
const WIDEST: f64 = 80.0;

/// Expected circle of a ball, in a picture without lens distortion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gate {
    /// Horizontal position, in pixels from the left edge.
    pub u: f64,
    /// Vertical position, in pixels from the top edge.
    pub v: f64,
    /// Radius, in pixels.
    pub r: f64,
    /// Maximum distance of the circle's centre from the expected position, in pixels.
    pub reach: f64,
}

/// Returns the gates of a camera (0 left, 1 right) for a picture taken at head pose `pose`.
///
/// Balls outside of the camera's view get no gate. An invalid pose gives no gates.
pub fn gates(
    cameras: &Cameras,
    camera: usize,
    predictions: &BallPredictions,
    pose: &HeadPose,
) -> impl Iterator<Item = Gate> {
    let pair = Camera::pair(cameras);
    let head = Head::new(pose);
    let balls = predictions.valid().to_vec();
    balls.into_iter().filter_map(move |ball| {
        let head = head.as_ref()?;
        let view = View::new(*pair.get(camera)?, head);
        let dt = (pose.t_ns as f64 - ball.t_ns as f64) * 1e-9;
        let flight = Flight::of(&ball).after(dt);
        let circle = view.see(&flight.p)?;
        let variance = Matrix3::from_fn(|i, j| {
            let c = &ball.covariance;
            c[i][j] + dt * (c[i][j + 3] + c[i + 3][j]) + dt * dt * c[i + 3][j + 3]
        });
        // Pixels per metre at the ball's distance.
        let pixels = circle.z / crate::flight::BALL_RADIUS;
        let reach = MARGIN + DEVIATIONS * pixels * variance.trace().max(0.0).sqrt();
        Some(Gate {
            u: circle.x,
            v: circle.y,
            r: circle.z,
            reach: reach.min(WIDEST),
        })
    })
}
