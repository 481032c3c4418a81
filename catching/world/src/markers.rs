//! Markers on the wrists for the calibration, as detected in both pictures or as drawn into them.
//!
//! A marker is a small ball on a stalk, visible from all sides; occlusion is not simulated.

use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use tactnet_catching_packets::ARMS;

use crate::cameras::{CAMERAS, Cameras};
use crate::error::{WorldError, from_to, not_negative, positive, probability};
use crate::robot::FrameMotion;
use crate::stream::{Stream, picture};

tactnet_catching_packets::settings! {
    /// Nominal places of the markers, and settings of their detector.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct MarkersConfig in "markers.": WorldError {
        /// Left and right place in the frame of the arm's last link (origin at the wrist), in m; `errors.marker`
        /// displaces them.
        pub places: [[f64; 3]; ARMS] = [[0.05, 0.04, 0.06], [0.05, -0.04, 0.06]] => from_to([f64::MIN, f64::MAX], "numbers"),
        /// Radius in rendered pictures, in m.
        pub radius: f64 = 0.01 => positive,
        /// Standard deviation of a feature along each axis, in pixels.
        pub noise: f64 = 0.25 => not_negative,
        /// Detection probability of a marker in a picture, independent for each camera.
        pub detection: f64 = 0.97 => probability,
        /// Probability that a detection is an outlier.
        pub outlying: f64 = 0.03 => probability,
        /// Maximum displacement of an outlier along each axis, in pixels.
        pub away: f64 = 60.0 => not_negative,
    }
}

impl MarkersConfig {
    /// Returns the frames of the markers.
    ///
    /// - `wrists`: frames of the arms' last links
    /// - `moved`: displacement of the markers from their nominal places, in m
    pub(crate) fn frames(
        &self,
        wrists: &[FrameMotion; ARMS],
        moved: &[Vector3<f64>; ARMS],
    ) -> [FrameMotion; ARMS] {
        std::array::from_fn(|arm| {
            let wrist = wrists[arm];
            let away = wrist.rotation * (Vector3::from(self.places[arm]) + moved[arm]);
            FrameMotion {
                position: wrist.position + away,
                velocity: wrist.velocity + wrist.rate.cross(&away),
                ..wrist
            }
        })
    }

    /// Returns the detections in the latest pictures, in pixels: of the left and the right marker, each in the left
    /// and the right picture.
    ///
    /// - `markers`: frames of the markers
    pub(crate) fn find(
        &self,
        cameras: &Cameras,
        head: &FrameMotion,
        markers: &[FrameMotion; ARMS],
        seed: u64,
    ) -> [[Option<[f64; 2]>; CAMERAS]; ARMS] {
        std::array::from_fn(|arm| {
            std::array::from_fn(|camera| {
                let index = picture(cameras.last_frame(), camera, arm as u64);
                let mut rng = Stream::Marker.rng(seed, index);
                let [found, outlying] = [rng.random::<f64>(), rng.random::<f64>()];
                let away: [f64; 2] =
                    std::array::from_fn(|_| self.away * (2.0 * rng.random::<f64>() - 1.0));
                let noise: [f64; 2] = std::array::from_fn(|_| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    noise * self.noise
                });
                let pixel = cameras.project(camera, head, &markers[arm].position)?;
                let aside = if outlying < self.outlying {
                    away
                } else {
                    noise
                };
                (found < self.detection).then(|| [pixel[0] + aside[0], pixel[1] + aside[1]])
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;
    use tactnet_catching_packets::RobotDescription;

    use super::*;
    use crate::cameras::CamerasConfig;
    use crate::planted::PlantedErrors;

    fn frame(position: Vector3<f64>) -> FrameMotion {
        FrameMotion::still(position, Matrix3::identity())
    }

    /// 2000 markers straight ahead, 0.8 m in front of the centre between the cameras.
    #[test]
    fn features_have_the_given_noise_and_shares() {
        let config = MarkersConfig::default();
        let optics = RobotDescription::nominal().cameras;
        let head = frame(Vector3::zeros());
        let wrist = frame(Vector3::from(optics.centre) + Vector3::new(0.8, 0.0, 0.0));
        let (mut found, mut outlying, mut squares) = (0.0, 0.0, 0.0);
        let runs = 1000u64;
        for seed in 0..runs {
            let (detector, errors) = (CamerasConfig::default(), PlantedErrors::default());
            let cameras = Cameras::new(&detector, &errors, &optics, seed);
            let [left, _] = config.find(&cameras, &head, &[wrist; ARMS], seed);
            // Half the baseline at 0.8 m; to the right in the left picture.
            let expected = [800.0 + 1386.0 * 0.1 / 0.8, 800.0 - 1386.0 * 0.1 / 0.8];
            for (pixel, expected) in left.iter().zip(expected) {
                let Some([u, v]) = pixel else { continue };
                found += 1.0;
                if (u - expected).abs() < 1.5 && (v - 625.0).abs() < 1.5 {
                    squares += (u - expected).powi(2);
                } else {
                    outlying += 1.0;
                }
            }
        }
        let of = 2.0 * runs as f64;
        // Five standard deviations each. An outlier falls next to the marker with probability 1/1600.
        assert!((found / of - 0.97f64).abs() < 0.02, "{}", found / of);
        assert!((outlying / found - 0.03f64).abs() < 0.02, "{outlying}");
        let noise = f64::sqrt(squares / (found - outlying));
        assert!((noise / 0.25 - 1.0).abs() < 0.09, "{noise}");
    }
}
