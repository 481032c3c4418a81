//! Rendered pictures and the circles detected in them.

use bytemuck::Zeroable;
use tactnet_catching::Robot;
use tactnet_catching::circles::{CircleConfig, CircleDetector};
use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose};
use tactnet_catching_world::{Pictures, Truth, WorldConfig};

use crate::error::TrialError;

/// Both cameras with a detector.
pub(crate) struct Eyes {
    pictures: Pictures,
    detector: CircleDetector,
    pixels: Vec<u8>,
    frame: u64,
}

impl Eyes {
    pub fn new(robot: &Robot, world: &WorldConfig, seed: u64) -> Result<Self, TrialError> {
        let description = robot.description();
        let pictures = Pictures::new(description, world, seed)?;
        let [width, height] = pictures.size();
        Ok(Self {
            detector: CircleDetector::new(&description.cameras, CircleConfig::default()),
            pictures,
            pixels: vec![0; width * height],
            frame: 0,
        })
    }

    /// Renders both pictures of a time and detects circles.
    ///
    /// - `expected`: predicted balls, which give gates, and estimated head pose
    pub fn see(
        &mut self,
        truth: &Truth,
        expected: Option<(&BallPredictions, &HeadPose)>,
    ) -> [Circles; 2] {
        let frame = self.frame;
        self.frame += 1;
        std::array::from_fn(|camera| {
            let mut circles = Circles {
                frame,
                exposure_ns: truth.time_ns,
                camera: camera as u32,
                ..Circles::zeroed()
            };
            self.pictures.draw(truth, frame, camera, &mut self.pixels);
            self.detector
                .find_expected(&self.pixels, expected, &mut circles);
            circles
        })
    }
}
