//! Markers among the detected circles of a pair of pictures.
//!
//! A marker is a ball of known radius, so each circle gives a position in its camera's frame. The marker must be near
//! its expected position in both frames, and both deviations must agree. Background is far away: its circles would have
//! to be balls that differ between the cameras by the baseline. A circle without a partner is not used.

use nalgebra::Vector3;
use tactnet_catching_packets::packets::{Circle, Circles};

use super::model::Model;
use super::session::Picture;
use super::unknowns::Unknowns;
use crate::track::{CAMERAS, Camera};

/// Radius of a marker, in m.
pub(crate) const MARKER_RADIUS: f64 = 0.01;
/// Maximum distance of a marker from its expected position, in m. Robots without calibration are up to 0.06 off.
const REACH: f64 = 0.1;
/// Maximum difference of the deviations in both cameras' frames: constant in m, and relative to the distance of the
/// marker. It covers errors of the neck and of the cameras' mounts and lenses.
const DISAGREEMENT: [f64; 2] = [0.012, 0.04];
/// Weight of deviations along the optical axis, which follow from radii: half a pixel of 20 is 3 % of the distance.
const ALONG: f64 = 0.5;

/// A circle that may be the marker.
struct Candidate {
    /// Deviation from the expected position in the camera's frame, in m, weighted along the optical axis.
    deviation: Vector3<f64>,
    /// Projection of the centre of the ball, in pixels. It is not the centre of the outline.
    pixel: [f64; 2],
    response: f64,
}

impl Model {
    /// Returns the marker's features in a pair of pictures, or `None` unless both pictures show it.
    ///
    /// - `picture`: arm and neck at the exposure
    /// - `circles`: detected circles of the left and the right picture
    pub(crate) fn find_marker(
        &self,
        x: &Unknowns,
        picture: &Picture,
        circles: &[Circles; CAMERAS],
    ) -> [Option<[f64; 2]>; CAMERAS] {
        let expected = [0, 1].map(|camera| self.marker(x, picture, camera));
        let cameras = Camera::pair(&self.robot().description().cameras);
        let [left, right] = [0, 1].map(|camera| {
            let of = |circle| Candidate::of(circle, &cameras[camera], &expected[camera]);
            circles[camera]
                .valid()
                .iter()
                .filter_map(of)
                .collect::<Vec<_>>()
        });
        let most = DISAGREEMENT[0] + DISAGREEMENT[1] * expected[0].norm();
        let pairs = left.iter().flat_map(|a| right.iter().map(move |b| [a, b]));
        pairs
            .map(|[a, b]| {
                let off = (a.deviation - b.deviation).norm() / most;
                (off, a.response + b.response - off, [a.pixel, b.pixel])
            })
            .filter(|(off, ..)| *off < 1.0)
            .max_by(|(_, a, _), (_, b, _)| a.total_cmp(b))
            .map_or([None; CAMERAS], |(.., pixels)| pixels.map(Some))
    }
}

impl Candidate {
    fn of(circle: &Circle, camera: &Camera, expected: &Vector3<f64>) -> Option<Self> {
        let place = camera.sphere(&Vector3::new(circle.u, circle.v, circle.r), MARKER_RADIUS);
        let mut deviation = place - expected;
        deviation.x *= ALONG;
        (deviation.norm() < REACH).then(|| Self {
            deviation,
            pixel: [0, 1].map(|i| camera.size[i] / 2.0 - camera.focal * place[i + 1] / place.x),
            response: circle.response,
        })
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::super::problem::CalibrationConfig;
    use super::super::session::NeckMotion;
    use super::*;
    use crate::flight::BALL_RADIUS;
    use crate::robot::Robot;

    fn circle([u, v, r]: [f64; 3]) -> Circle {
        let response = 0.95;
        Circle { u, v, r, response }
    }

    /// Circles and expected features of the right arm's marker, which is `moved` from its expected position, before
    /// `background` circles as distinct as itself.
    fn scene(
        moved: &Vector3<f64>,
        background: usize,
        rng: &mut ChaCha8Rng,
    ) -> (Model, Picture, [Circles; CAMERAS], [[f64; 2]; CAMERAS]) {
        let model = Model::new(&Robot::nominal());
        let robot = model.robot();
        let q = robot.ready(1);
        let gaze = robot.look_at(&robot.arm(1).forward(&q).position);
        let picture = Picture::without_features(1, q, [0.0; 7], NeckMotion::standing(gaze));
        let x = CalibrationConfig::default().priors.guess();
        let cameras = Camera::pair(&robot.description().cameras);
        let mut pixels = [[0.0; 2]; CAMERAS];
        let mut circles = [0, 1].map(|camera| {
            let place = model.marker(&x, &picture, camera) + moved;
            pixels[camera] =
                [0, 1].map(|i| cameras[camera].size[i] / 2.0 - 1386.0 * place[i + 1] / place.x);
            // A ball of another size at a proportional distance has the same outline.
            let ball = cameras[camera].offset + place * (BALL_RADIUS / MARKER_RADIUS);
            let outline = cameras[camera].outline(&ball).unwrap();
            let mut circles = Circles::zeroed();
            circles.circles[0] = circle(outline.into());
            circles.count = 1;
            circles
        });
        for i in 1..=background {
            let [u, v, r] = [1600.0, 1250.0, 80.0].map(|most| most * rng.random::<f64>());
            for circles in &mut circles {
                // Far away, so at the same place in both pictures up to errors of the cameras.
                let [u, v] = [u, v].map(|x| x + 10.0 * (rng.random::<f64>() - 0.5));
                circles.circles[i] = circle([u, v, r + 5.0]);
                circles.count += 1;
            }
        }
        (model, picture, circles, pixels)
    }

    #[test]
    fn a_marker_six_centimetres_off_is_found_before_much_background() {
        let x = CalibrationConfig::default().priors.guess();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let [mut wrong, mut wrong_without] = [0; 2];
        for _ in 0..1000 {
            let moved = Vector3::from_fn(|_, _| 0.07 * (rng.random::<f64>() - 0.5));
            let (model, picture, mut circles, pixels) = scene(&moved, 8, &mut rng);
            let found = model.find_marker(&x, &picture, &circles);
            let off = |i: usize| {
                let found = found[i].unwrap();
                (found[0] - pixels[i][0]).hypot(found[1] - pixels[i][1])
            };
            // Rounding; the outline's centre is up to 0.5 pixels off.
            wrong += usize::from(off(0).max(off(1)) > 1e-6);
            // Hidden from one camera.
            circles[0].circles[0].u += 300.0;
            let found = model.find_marker(&x, &picture, &circles);
            wrong_without += usize::from(found != [None; CAMERAS]);
        }
        // Eight circles of at most 85 pixels; few happen to agree with each other or with the marker in one picture.
        assert!(wrong == 0 && wrong_without <= 20, "{wrong} {wrong_without}");
    }

    #[test]
    fn a_ball_far_from_the_arm_is_no_marker() {
        let x = CalibrationConfig::default().priors.guess();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let moved = Vector3::new(0.0, 0.13, 0.0);
        let (model, picture, circles, _) = scene(&moved, 0, &mut rng);
        assert_eq!(model.find_marker(&x, &picture, &circles), [None; CAMERAS]);
    }
}
