//! Where balls are expected in the next picture.

use nalgebra::{Matrix3, Vector3};
use tactnet_catching_packets::Cameras;
use tactnet_catching_packets::packets::{BallPredictions, HeadPose};

use crate::flight::Flight;
use crate::track::{Camera, Head, View};

/// Standard deviations that a gate holds.
const DEVIATIONS: f64 = 4.0;
/// Beyond that, pixels: of the detector, and of what the head's pose is wrong by.
const MARGIN: f64 = 8.0;
/// Widest gate, pixels.
const WIDEST: f64 = 80.0;

/// Where a ball is expected: a circle as a lens without distortion would show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gate {
    /// Pixels from the left.
    pub u: f64,
    /// Pixels from the top.
    pub v: f64,
    /// Radius, pixels.
    pub r: f64,
    /// How far its centre may be from there, pixels.
    pub reach: f64,
}

/// Returns the gates of a camera (0 left, 1 right) for a picture taken when the head is at `pose`.
///
/// Balls that will not be before the camera have none; neither has any if the pose makes no sense.
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
        let flight = Flight {
            p: Vector3::from(ball.p),
            v: Vector3::from(ball.v),
            k: ball.k,
            lift: Vector3::from(ball.lift),
        };
        let dt = (pose.t_ns as f64 - ball.t_ns as f64) * 1e-9;
        let flight = flight.after(dt);
        let circle = view.see(&flight.p)?;
        let variance = Matrix3::from_fn(|i, j| {
            let c = &ball.covariance;
            c[i][j] + dt * (c[i][j + 3] + c[i + 3][j]) + dt * dt * c[i + 3][j + 3]
        });
        // Metres to pixels, as at the ball's distance.
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
