//! Depth camera in the head, which sees boxes, the floor and the robot itself.
//!
//! Depth is measured along the optical axis. Its noise grows with the square of the depth, as for stereo
//! triangulation. The depth is 0 (invalid) out of range, at edges and at random pixels.

use nalgebra::{Matrix3, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use crate::error::{WorldError, from_to, not_negative, positive, probability, rising};
use crate::obstacles::StandingBox;
use crate::robot::FrameMotion;
use crate::shape::PlacedCapsule;
use crate::stream::Stream;

/// Relative depth difference between neighbouring pixels that counts as an edge.
const EDGE: f32 = 0.05;

tactnet_catching_packets::settings! {
    /// Settings of the depth camera. Its axes are those of the head: x ahead, y left, z up.
    ///
    /// 0.5 megapixels, horizontal field of view 70 degrees; noise of the first Kinect (Khoshelham and Elberink 2012:
    /// 1.4 mm at 1 m).
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)] #[serde(deny_unknown_fields, default)]
    pub struct DepthConfig in "depth.": WorldError {
        /// Position in the head frame, in m.
        pub position: [f64; 3] = [0.08, 0.0, 0.1] => from_to([-1.0, 1.0], "-1 to 1 m"),
        /// Width in pixels.
        pub width: u32 = 816 => from_to([1.0, 10_000.0], "1 to 10000 pixels"),
        /// Height in pixels.
        pub height: u32 = 612 => from_to([1.0, 10_000.0], "1 to 10000 pixels"),
        /// Focal length, in pixels.
        pub focal: f64 = 582.7 => positive,
        /// Standard deviation at a depth of 1 m, in m.
        pub noise: f64 = 0.0015 => not_negative,
        /// Minimum and maximum measured depth, in m.
        pub range: [f64; 2] = [0.3, 4.0] => rising(f64::MIN_POSITIVE, "[least, greatest], greater than 0"),
        /// Probability of an invalid pixel.
        pub holes: f64 = 0.02 => probability,
        /// Probability of an invalid pixel at an edge.
        pub edge_holes: f64 = 0.7 => probability,
    }
}

impl DepthConfig {
    /// Renders a depth picture: the depth along the optical axis in m, row by row from the top left; 0 is invalid.
    ///
    /// - `number`: number of the picture, which selects its noise
    pub(crate) fn take(
        &self,
        seed: u64,
        number: u64,
        head: &FrameMotion,
        boxes: &[StandingBox],
        own: &[PlacedCapsule],
    ) -> Vec<f32> {
        let (width, height) = (self.width as usize, self.height as usize);
        let view = View {
            origin: head.position + head.rotation * Vector3::from(self.position),
            rotation: head.rotation,
            focal: self.focal,
            middle: [0.5 * width as f64, 0.5 * height as f64],
            size: [width, height],
        };
        let mut depth = vec![f32::INFINITY; width * height];
        for row in 0..height {
            for column in 0..width {
                let direction = view.direction(column, row);
                let floor = (direction.z < 0.0).then(|| -view.origin.z / direction.z);
                let hits = boxes
                    .iter()
                    .filter_map(|standing| standing.on_ray(&view.origin, &direction));
                let nearest = hits.fold(floor.unwrap_or(f64::INFINITY), f64::min);
                depth[row * width + column] = nearest as f32;
            }
        }
        for capsule in own {
            let [columns, rows] = view.around(capsule);
            for row in rows {
                for column in columns.clone() {
                    if let Some(t) = capsule.on_ray(&view.origin, &view.direction(column, row)) {
                        let pixel = &mut depth[row * width + column];
                        *pixel = pixel.min(t as f32);
                    }
                }
            }
        }
        self.spoil(seed, number, &mut depth);
        depth
    }

    /// Adds noise and invalid pixels.
    fn spoil(&self, seed: u64, number: u64, depth: &mut [f32]) {
        let width = self.width as usize;
        let mut rng = Stream::Depth.rng(seed, number);
        let [least, most] = self.range.map(|depth| depth as f32);
        let exact = depth.to_vec();
        for (i, pixel) in depth.iter_mut().enumerate() {
            let there = exact[i];
            if !(least..=most).contains(&there) {
                *pixel = 0.0;
                continue;
            }
            let differs = |other: Option<&f32>| {
                other.is_some_and(|other| (other - there).abs() > EDGE * there)
            };
            let edge = differs(exact.get(i + 1))
                || differs(exact.get(i + width))
                || differs(exact.get(i.wrapping_sub(1)))
                || differs(exact.get(i.wrapping_sub(width)));
            let lost = if edge { self.edge_holes } else { self.holes };
            let normal: f32 = StandardNormal.sample(&mut rng);
            *pixel = if rng.random::<f64>() < lost {
                0.0
            } else {
                (there + normal * self.noise as f32 * there * there).max(0.0)
            };
        }
    }
}

struct View {
    origin: Vector3<f64>,
    rotation: Matrix3<f64>,
    focal: f64,
    middle: [f64; 2],
    size: [usize; 2],
}

impl View {
    /// Returns the direction of a pixel's ray in the inertial frame, with length 1 m along the optical axis.
    fn direction(&self, column: usize, row: usize) -> Vector3<f64> {
        let left = (self.middle[0] - (column as f64 + 0.5)) / self.focal;
        let up = (self.middle[1] - (row as f64 + 0.5)) / self.focal;
        self.rotation * Vector3::new(1.0, left, up)
    }

    /// Returns the ranges of columns and rows that may show a capsule.
    fn around(&self, capsule: &PlacedCapsule) -> [std::ops::Range<usize>; 2] {
        let middle = self.rotation.tr_mul(&(capsule.middle() - self.origin));
        let reach = capsule.reach();
        let near = middle.x - reach;
        [(middle.y, 0), (middle.z, 1)].map(|(aside, side)| {
            if middle.x + reach < 0.0 {
                return 0..0;
            }
            if near < 0.05 {
                return 0..self.size[side];
            }
            let slopes = [aside - reach, aside + reach]
                .map(|aside| [aside / near, aside / (middle.x + reach)]);
            let slopes = slopes.as_flattened().iter().copied();
            let least = slopes.clone().fold(f64::INFINITY, f64::min);
            let most = slopes.fold(f64::NEG_INFINITY, f64::max);
            let pixel = |slope: f64| {
                (self.middle[side] - self.focal * slope).clamp(0.0, self.size[side] as f64)
            };
            pixel(most).floor() as usize..pixel(least).ceil() as usize
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::obstacles::{BoxConfig, ObstaclesConfig};

    fn head(tilt: f64) -> FrameMotion {
        let rotation = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), tilt);
        FrameMotion::still(Vector3::new(0.0, 0.0, 1.5), rotation.into_inner())
    }

    fn exact() -> DepthConfig {
        DepthConfig {
            position: [0.0; 3],
            noise: 0.0,
            holes: 0.0,
            edge_holes: 0.0,
            ..DepthConfig::default()
        }
    }

    #[test]
    fn the_floor_is_as_far_as_it_is() {
        let picture = exact().take(1, 0, &head(0.6), &[], &[]);
        assert_eq!(picture.len(), 816 * 612);
        let middle = picture[306 * 816 + 408];
        // Depth along the axis: height divided by the sine of the tilt, with an error of half a pixel.
        let off = f64::from(middle) - 1.5 / 0.6f64.sin();
        assert!(off.abs() < 5e-3, "{middle}");
        // Beyond 4 m the depth is invalid.
        let level = exact().take(1, 0, &head(0.0), &[], &[]);
        assert!(level[..816].iter().all(|x| *x == 0.0));
    }

    #[test]
    fn noise_grows_with_the_square_of_the_depth() {
        let deviation = |tilt: f64| {
            let config = DepthConfig {
                holes: 0.1,
                position: [0.0; 3],
                ..DepthConfig::default()
            };
            let take = |config: DepthConfig| config.take(1, 0, &head(tilt), &[], &[]);
            let (noisy, clean) = (take(config), take(exact()));
            let rows = 300 * 816..312 * 816;
            let pairs = || rows.clone().filter(|i| noisy[*i] > 0.0);
            let squares: f64 = pairs()
                .map(|i| f64::from(noisy[i] - clean[i]).powi(2))
                .sum();
            let depth: f64 =
                pairs().map(|i| f64::from(clean[i])).sum::<f64>() / pairs().count() as f64;
            let measured = pairs().count() as f64 / rows.len() as f64;
            assert!((measured - 0.9).abs() < 0.02, "{measured}");
            ((squares / pairs().count() as f64).sqrt(), depth)
        };
        for tilt in [0.45, 0.9, 1.4] {
            let (found, depth) = deviation(tilt);
            let expected = 0.0015 * depth * depth;
            assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");
        }
    }

    #[test]
    fn what_stands_before_the_floor_hides_it_and_the_robot_sees_itself() {
        let boxes = vec![BoxConfig::fixed([1.0, 0.0, 0.75], [0.4, 0.4, 1.5])];
        let standing = ObstaclesConfig { boxes }.place(1, 0, |_| true);
        let own = PlacedCapsule {
            ends: [Vector3::new(0.5, 0.3, 1.4), Vector3::new(0.6, 0.3, 1.4)],
            radius: 0.08,
        };
        let picture = exact().take(1, 0, &head(0.0), &standing, &[own]);
        let at = |up: f64, left: f64| {
            let column = (408.0 - 582.7 * left) as usize;
            let row = (306.0 - 582.7 * up) as usize;
            picture[row * 816 + column]
        };
        // Front of the box, at a pixel just below its top edge.
        assert!((at(-0.1, 0.0) - 0.8).abs() < 1e-5);
        let arm = at(-0.1 / 0.5, 0.3 / 0.5);
        assert!((0.4..0.6).contains(&arm), "{arm}");
        let without = exact().take(1, 0, &head(0.0), &standing, &[]);
        assert_ne!(without, picture);
    }
}
