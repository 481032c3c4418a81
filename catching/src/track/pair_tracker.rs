//! Tracker behind measurements that arrive one by one: raw circles of each camera, and head poses.

use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose};

use super::camera::CAMERAS;
use super::config::{TrackConfig, TrackError};
use super::tracker::BallTracker;
use crate::calibrate::Corrections;
use crate::pose::{POSES, PoseRing};

/// Predicts balls from head poses and circles of both cameras, in any order of arrival.
#[derive(Debug, Clone)]
pub struct PairTracker {
    corrections: Corrections,
    tracker: BallTracker,
    poses: PoseRing,
    newest: [Option<Circles>; CAMERAS],
}

impl PairTracker {
    /// Creates a tracker without measurements.
    ///
    /// # Errors
    /// Invalid settings, or cameras without overlap.
    pub fn new(corrections: Corrections, config: TrackConfig) -> Result<Self, TrackError> {
        Ok(Self {
            tracker: BallTracker::new(corrections.robot().description(), config)?,
            corrections,
            poses: PoseRing::new(POSES),
            newest: [None; CAMERAS],
        })
    }

    /// Adds a head pose.
    pub fn pose(&mut self, pose: &HeadPose) {
        self.poses.put(*pose);
    }

    /// Returns the head pose at a time, or `None` if it is unknown.
    pub fn head(&self, t_ns: u64) -> Option<HeadPose> {
        self.poses.at(t_ns)
    }

    /// Adds the circles of one picture in camera coordinates. Once both pictures of an exposure are there, returns
    /// their circles as the cameras of the description would see them.
    pub fn pair(&mut self, seen: &Circles) -> Option<[Circles; CAMERAS]> {
        *self.newest.get_mut(seen.camera as usize)? = Some(self.corrections.circles(seen));
        let [Some(left), Some(right)] = self.newest else {
            return None;
        };
        (left.frame == right.frame).then(|| {
            self.newest = [None; CAMERAS];
            [left, right]
        })
    }

    /// Returns the predictions for a pair of pictures, or `None` if the head pose at that time is unknown or the pair
    /// is invalid.
    pub fn predict(&mut self, [left, right]: &[Circles; CAMERAS]) -> Option<BallPredictions> {
        let head = self.head(left.exposure_ns)?;
        self.tracker.push([left, right], &head).ok()
    }
}
