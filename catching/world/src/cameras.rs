//! Stereo cameras without pictures: circles computed from the true state, with noise, misses and clutter.
//!
//! The outline of a sphere of radius `R` at distance `d`, `theta` off the optical axis, with `beta = asin(R / d)`, is
//! an ellipse. Its centre is at `f sin 2theta / (cos 2theta + cos 2beta)` from the principal point, its radial
//! semi-axis is `f sin 2beta / (cos 2theta + cos 2beta)`, and its tangential semi-axis is `f R / sqrt(z^2 - R^2)`.
//! The radius of a circle is the mean of both semi-axes.

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Poisson, StandardNormal};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::Cameras as Optics;
use tactnet_catching_packets::packets::{Circle, Circles, MAX_CIRCLES};

use crate::error::{WorldError, from_to, not_negative, probability, rising};
use crate::planted::{CameraErrors, PlantedErrors, StampDelay};
use crate::robot::FrameMotion;
use crate::stream::{Stream, picture};

pub(crate) const CAMERAS: usize = 2;
/// Minimum and maximum detector response to a ball.
const BALL_RESPONSE: [f64; 2] = [0.75, 0.98];
/// Minimum and maximum detector response to clutter.
const CLUTTER_RESPONSE: [f64; 2] = [0.7, 0.85];

tactnet_catching_packets::settings! {
    /// Settings of the circle detector.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct CamerasConfig in "cameras.": WorldError {
        /// Standard deviation of the centre along each axis, in pixels.
        pub centre_noise: f64 = 0.3 => not_negative,
        /// Standard deviation of the radius, in pixels.
        pub radius_noise: f64 = 0.4 => not_negative,
        /// Detection probability of a ball in a picture, independent for each camera.
        pub detection: f64 = 0.95 => probability,
        /// Mean number of false detections per picture (Poisson).
        pub clutter: f64 = 1.0 => from_to([0.0, MAX_CIRCLES as f64], "0 to 32 circles per picture"),
        /// Minimum and maximum radius of false detections, in pixels.
        pub clutter_radius: [f64; 2] = [6.0, 40.0] => rising(f64::MIN_POSITIVE, "[least, greatest], greater than 0"),
    }
}

#[derive(Debug, Clone)]
pub(crate) struct Cameras {
    config: CamerasConfig,
    clutter: Option<Poisson<f64>>,
    optics: Optics,
    /// Positions in the head frame in m, and rotations from the camera frames to the head frame.
    mounts: [(Vector3<f64>, Matrix3<f64>); CAMERAS],
    errors: [CameraErrors; CAMERAS],
    /// Delay of the timestamps.
    late: StampDelay,
    seed: u64,
    /// Time of the first picture, in s.
    phase: f64,
    /// Number of pictures so far.
    frame: u64,
}

impl Cameras {
    pub(crate) fn new(
        config: &CamerasConfig,
        errors: &PlantedErrors,
        optics: &Optics,
        seed: u64,
    ) -> Self {
        let (shift, turn) = errors.camera_mount(seed);
        let centre = Vector3::from(optics.centre) + shift;
        let [late, _] = errors.clocks(seed);
        let errors = errors.each_camera(seed);
        let mounts = std::array::from_fn(|camera| {
            let side = optics.baseline * (0.5 - camera as f64);
            let eye = centre
                + turn * Vector3::new(0.0, side, 0.0)
                + Vector3::from(optics.shifts[camera])
                + errors[camera].shift;
            (eye, turn * errors[camera].turn)
        });
        Self {
            mounts,
            errors,
            late,
            clutter: Poisson::new(config.clutter).ok(),
            config: config.clone(),
            optics: *optics,
            seed,
            phase: Stream::CameraPhase.rng(seed, 0).random::<f64>() / optics.rate,
            frame: 0,
        }
    }

    /// Returns true once for each picture, at the first tick at or after the middle of its exposure.
    pub(crate) fn due(&self, now_ns: u64) -> bool {
        now_ns as f64 * 1e-9 >= self.phase + self.frame as f64 / self.optics.rate
    }

    /// Returns the circles of both pictures at the current time. Balls are given by number and position in the
    /// inertial frame, in m.
    pub(crate) fn take(
        &mut self,
        now_ns: u64,
        head: &FrameMotion,
        radius: f64,
        balls: impl Iterator<Item = (u64, Vector3<f64>)> + Clone,
    ) -> [Circles; CAMERAS] {
        let pictures = std::array::from_fn(|camera| {
            let mut circles = Circles {
                frame: self.frame,
                exposure_ns: now_ns + self.late.of(self.frame),
                camera: camera as u32,
                count: 0,
                circles: [Circle {
                    u: 0.0,
                    v: 0.0,
                    r: 0.0,
                    response: 0.0,
                }; MAX_CIRCLES],
            };
            for (number, position) in balls.clone() {
                let mut rng = Stream::Outline.rng(self.seed, picture(self.frame, camera, number));
                let outline = self.outline(camera, head, &position, radius);
                if let Some(circle) = outline.and_then(|circle| self.detect(circle, &mut rng)) {
                    push(&mut circles, circle);
                }
            }
            let mut rng = Stream::Clutter.rng(self.seed, picture(self.frame, camera, 0));
            let count = self.clutter.map_or(0.0, |poisson| poisson.sample(&mut rng)) as usize;
            for _ in 0..count.min(MAX_CIRCLES) {
                let circle = self.no_ball(&mut rng);
                push(&mut circles, circle);
            }
            let mut rng = Stream::Order.rng(self.seed, picture(self.frame, camera, 0));
            shuffle(&mut circles, &mut rng);
            circles
        });
        self.frame += 1;
        pictures
    }

    /// Returns the position of a camera in m and the rotation from its frame (x along the optical axis), both in the
    /// head frame.
    pub(crate) fn mount(&self, camera: usize) -> (Vector3<f64>, Matrix3<f64>) {
        self.mounts[camera]
    }

    /// Returns the number of the latest pictures.
    pub(crate) fn last_frame(&self) -> u64 {
        self.frame.saturating_sub(1)
    }

    /// Returns the projection of a point in pixels after undistortion with the described lens, or `None` outside the
    /// picture.
    pub(crate) fn project(
        &self,
        camera: usize,
        head: &FrameMotion,
        point: &Vector3<f64>,
    ) -> Option<[f64; 2]> {
        self.outline(camera, head, point, 0.0)
            .map(|circle| [circle.u, circle.v])
    }

    /// Returns the pixel at a distance `away` (pixels) from the principal point, in a direction (right, down) of
    /// length 1, with the planted lens distortion.
    fn on_sensor(&self, camera: usize, away: f64, [right, down]: [f64; 2]) -> [f64; 2] {
        let errors = &self.errors[camera];
        let [k1, k2] = errors.distortion;
        let s = (away / (self.optics.focal + errors.focal)).powi(2);
        let stretch = 1.0 + s * (k1 + s * k2);
        let (width, height) = (f64::from(self.optics.width), f64::from(self.optics.height));
        [
            width / 2.0 + errors.centre[0] + away * right * stretch,
            height / 2.0 + errors.centre[1] + away * down * stretch,
        ]
    }

    fn contains(&self, [u, v]: &[f64; 2]) -> bool {
        (0.0..f64::from(self.optics.width)).contains(u)
            && (0.0..f64::from(self.optics.height)).contains(v)
    }

    /// Returns the outline of a ball, or `None` if its centre is outside the picture.
    pub(crate) fn outline(
        &self,
        camera: usize,
        head: &FrameMotion,
        ball: &Vector3<f64>,
        radius: f64,
    ) -> Option<Circle> {
        let (eye, turn) = self.mount(camera);
        let seen = turn.tr_mul(&(head.rotation.tr_mul(&(ball - head.position)) - eye));
        // Axes: right, down, ahead.
        let (x, y, z) = (-seen.y, -seen.z, seen.x);
        let aside = x.hypot(y);
        if z <= radius {
            return None;
        }
        let double_theta = 2.0 * aside.atan2(z);
        let double_beta = 2.0 * (radius / seen.norm()).asin();
        let denominator = double_theta.cos() + double_beta.cos();
        if denominator <= 0.0 {
            return None;
        }
        let errors = &self.errors[camera];
        let focal = self.optics.focal + errors.focal;
        let away = focal * double_theta.sin() / denominator;
        let radial = focal * double_beta.sin() / denominator;
        let tangential = focal * radius / (z * z - radius * radius).sqrt();
        let (right, down) = if aside > 0.0 {
            (x / aside, y / aside)
        } else {
            (0.0, 0.0)
        };
        let [u, v] = self.on_sensor(camera, away, [right, down]);
        let circle = Circle {
            u,
            v,
            r: (radial + tangential) / 2.0,
            response: 1.0,
        };
        self.contains(&[u, v]).then_some(circle)
    }

    fn detect(&self, circle: Circle, rng: &mut ChaCha8Rng) -> Option<Circle> {
        let found = rng.random::<f64>() < self.config.detection;
        let mut noise = || -> f64 { StandardNormal.sample(rng) };
        let [u, v, r] = [noise(), noise(), noise()];
        let seen = Circle {
            u: circle.u + u * self.config.centre_noise,
            v: circle.v + v * self.config.centre_noise,
            // Detectors have a minimum radius.
            r: (circle.r + r * self.config.radius_noise).max(1.0),
            response: evenly(BALL_RESPONSE, rng),
        };
        // Balls wider than the picture are not detected.
        (found && seen.r <= f64::from(self.optics.width)).then_some(seen)
    }

    fn no_ball(&self, rng: &mut ChaCha8Rng) -> Circle {
        Circle {
            u: evenly([0.0, f64::from(self.optics.width)], rng),
            v: evenly([0.0, f64::from(self.optics.height)], rng),
            r: evenly(self.config.clutter_radius, rng),
            response: evenly(CLUTTER_RESPONSE, rng),
        }
    }
}

/// Draws a number from an interval.
pub(crate) fn evenly([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

fn push(circles: &mut Circles, circle: Circle) {
    if let Some(place) = circles.circles.get_mut(circles.count as usize) {
        *place = circle;
        circles.count += 1;
    }
}

/// Shuffle of Fisher and Yates. The one of `rand` may change its sequence in a minor release.
fn shuffle(circles: &mut Circles, rng: &mut ChaCha8Rng) {
    for last in (1..circles.count as usize).rev() {
        let other = (rng.random::<f64>() * (last + 1) as f64) as usize;
        circles.circles.swap(last, other.min(last));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use tactnet_catching_packets::RobotDescription;

    const RADIUS: f64 = 0.0425;

    fn head() -> FrameMotion {
        let rotation = nalgebra::Rotation3::new(Vector3::new(0.05, -0.1, 0.2));
        FrameMotion::still(Vector3::new(0.1, 0.0, 1.45), rotation.into_inner())
    }

    fn cameras(config: &CamerasConfig, seed: u64) -> Cameras {
        let optics = RobotDescription::nominal().cameras;
        Cameras::new(config, &PlantedErrors::default(), &optics, seed)
    }

    fn exact() -> CamerasConfig {
        CamerasConfig {
            centre_noise: 0.0,
            radius_noise: 0.0,
            detection: 1.0,
            clutter: 0.0,
            ..CamerasConfig::default()
        }
    }

    proptest! {
        /// Compares the outline with the projection of 5000 tangent rays of the sphere.
        #[test]
        fn an_outline_is_the_picture_of_the_tangent_rays(
            ahead in 0.4..6.0f64, aside in -0.4..0.4f64, up in -0.4..0.4f64, camera in 0..2usize,
        ) {
            let cameras = cameras(&exact(), 1);
            let eye = Vector3::new(0.08, 0.1 - 0.2 * camera as f64, 0.1);
            let ball = eye + Vector3::new(ahead, aside * ahead, up * ahead);
            let still = FrameMotion::still(Vector3::zeros(), Matrix3::identity());
            let found = cameras.outline(camera, &still, &ball, RADIUS).unwrap();
            let c = ball - eye;
            let d2 = c.norm_squared();
            let first = c.cross(&Vector3::z()).normalize();
            let second = c.cross(&first).normalize();
            let ring = RADIUS * (1.0 - RADIUS * RADIUS / d2).sqrt();
            let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
            for i in 0..5000 {
                let (sin, cos) = (f64::from(i) * std::f64::consts::TAU / 5000.0).sin_cos();
                let p = c * (1.0 - RADIUS * RADIUS / d2) + (first * cos + second * sin) * ring;
                let at = [800.0 - 1386.0 * p.y / p.x, 625.0 - 1386.0 * p.z / p.x];
                for k in 0..2 {
                    low[k] = low[k].min(at[k]);
                    high[k] = high[k].max(at[k]);
                }
            }
            // The extremes of an ellipse are symmetric about its centre. With 5000 points they are off by 2e-7 of the
            // radius, which is at most 150 pixels.
            prop_assert!((found.u - (low[0] + high[0]) / 2.0).abs() < 1e-3);
            prop_assert!((found.v - (low[1] + high[1]) / 2.0).abs() < 1e-3);
            // For an ellipse, half the squared width plus half the squared height is the sum of the squared
            // semi-axes, for any rotation. The squared mean differs by the squared half difference.
            let squares = ((high[0] - low[0]).powi(2) + (high[1] - low[1]).powi(2)) / 8.0;
            prop_assert!(found.r <= squares.sqrt() + 1e-3);
            prop_assert!(found.r > squares.sqrt() * 0.99);
        }
    }

    #[test]
    fn the_left_camera_sees_a_ball_farther_right() {
        let cameras = cameras(&exact(), 1);
        let ball = Vector3::new(3.0, 0.8, 1.5);
        let [left, right] =
            [0, 1].map(|camera| cameras.outline(camera, &head(), &ball, RADIUS).unwrap());
        // Disparity `f b / z` at about 3 m.
        let disparity = left.u - right.u;
        assert!((disparity - 1386.0 * 0.2 / 2.9).abs() < 5.0, "{disparity}");
        let above = ball + Vector3::z() * 0.1;
        let higher = cameras.outline(0, &head(), &above, RADIUS).unwrap();
        assert!(higher.v < left.v);
    }

    #[test]
    fn what_is_behind_or_outside_is_not_seen() {
        let cameras = cameras(&exact(), 1);
        let seen = |x: f64, y: f64| {
            let ball = Vector3::new(x, y, 1.5);
            cameras.outline(0, &head(), &ball, RADIUS)
        };
        assert!(seen(3.0, 0.6).is_some());
        assert!(seen(-3.0, -0.6).is_none());
        assert!(seen(3.0, 4.0).is_none());
        assert!(seen(0.2, 0.1).is_none());
    }

    #[test]
    fn noise_misses_and_clutter_have_the_given_size() {
        let config = CamerasConfig::default();
        let mut cameras = cameras(&config, 5);
        let ball = Vector3::new(3.0, 0.6, 1.5);
        let truth = cameras.outline(0, &head(), &ball, RADIUS).unwrap();
        let (mut found, mut clutter, mut squares) = (0, 0, [0.0; 2]);
        let pictures = 4000;
        for _ in 0..pictures {
            let [left, _] = cameras.take(0, &head(), RADIUS, [(7, ball)].into_iter());
            for circle in left.valid() {
                // Six standard deviations; clutter falls there with probability 1e-5.
                if (circle.u - truth.u).abs() < 1.8 && (circle.v - truth.v).abs() < 1.8 {
                    found += 1;
                    squares[0] += (circle.u - truth.u).powi(2);
                    squares[1] += (circle.r - truth.r).powi(2);
                } else {
                    clutter += 1;
                    assert!((6.0..40.0).contains(&circle.r));
                }
            }
        }
        let rate = |count: i32| f64::from(count) / f64::from(pictures);
        // Each within five standard deviations for 4000 pictures.
        assert!((rate(found) - 0.95).abs() < 0.018, "{}", rate(found));
        assert!((rate(clutter) - 1.0).abs() < 0.08, "{}", rate(clutter));
        let spread = |i: usize| (squares[i] / f64::from(found)).sqrt();
        assert!((spread(0) / 0.3 - 1.0).abs() < 0.06, "{}", spread(0));
        assert!((spread(1) / 0.4 - 1.0).abs() < 0.06, "{}", spread(1));
    }

    #[test]
    fn clutter_does_not_change_how_a_ball_is_seen() {
        let ball = Vector3::new(3.0, 0.6, 1.5);
        let without = CamerasConfig {
            clutter: 0.0,
            ..CamerasConfig::default()
        };
        let mut clean = cameras(&without, 5);
        let mut dirty = cameras(&CamerasConfig::default(), 5);
        for _ in 0..50 {
            let clean = clean.take(0, &head(), RADIUS, [(0, ball)].into_iter());
            let dirty = dirty.take(0, &head(), RADIUS, [(0, ball)].into_iter());
            for (clean, dirty) in clean.iter().zip(&dirty) {
                assert!(clean.valid().iter().all(|c| dirty.valid().contains(c)));
            }
        }
    }

    #[test]
    fn a_picture_never_has_more_circles_than_fit() {
        let config = CamerasConfig {
            clutter: 32.0,
            ..CamerasConfig::default()
        };
        let mut cameras = cameras(&config, 5);
        for _ in 0..100 {
            let ball = (0, Vector3::new(3.0, 0.6, 1.5));
            for circles in cameras.take(0, &head(), RADIUS, [ball].into_iter()) {
                assert!(circles.valid().len() <= MAX_CIRCLES);
            }
        }
    }
}
