//! Circle detector of one camera, behind head poses and predictions that arrive one by one.

use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose};

use super::{CircleConfig, CircleDetector};
use crate::calibrate::Corrections;
use crate::pose::{POSES, PoseRing};

/// Maximum difference between the exposures of a picture and of predictions that give gates, in ns.
const NEAR_NS: u64 = 500_000_000;

/// Detects circles in the pictures of a camera.
#[derive(Debug, Clone)]
pub struct Eye {
    corrections: Corrections,
    heads: PoseRing,
    detector: CircleDetector,
}

impl Eye {
    /// Creates a detector without head poses.
    pub fn new(corrections: Corrections) -> Self {
        let cameras = &corrections.robot().description().cameras;
        Self {
            detector: CircleDetector::new(cameras, CircleConfig::default()),
            heads: PoseRing::new(POSES),
            corrections,
        }
    }

    /// Returns the width and height of the camera's pictures, in pixels.
    pub fn size(&self) -> [u32; 2] {
        let cameras = &self.corrections.robot().description().cameras;
        [cameras.width, cameras.height]
    }

    /// Adds a head pose.
    pub fn pose(&mut self, pose: &HeadPose) {
        self.heads.put(*pose);
    }

    /// Detects the circles of a picture, with gates at predicted balls.
    ///
    /// - `circles`: output, with frame number, time stamp and camera of the picture
    pub fn step(&mut self, pixels: &[u8], balls: Option<&BallPredictions>, circles: &mut Circles) {
        let exposure_ns = self.corrections.exposure(circles.exposure_ns);
        let near = |balls: &&BallPredictions| balls.exposure_ns.abs_diff(exposure_ns) < NEAR_NS;
        let head = self.heads.at(exposure_ns).or(self.heads.last().copied());
        let expected = balls.filter(near).zip(head.as_ref());
        self.detector.find_expected(pixels, expected, circles);
    }
}
