//! Tracker process: predicts balls from the circles of both cameras and the head pose.

use tactnet_catching::calibrate::Corrections;
use tactnet_catching::pose::PoseRing;
use tactnet_catching::track::{BallTracker, TrackConfig};
use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose};
use tactnet_channel::{Bus, GetPort, Priority, Start, now_ns};

use crate::channels::{CIRCLES, HEAD_POSE, PREDICTION};
use crate::latest_value::PATIENCE;
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Number of stored poses: 0.6 s.
const POSES: usize = 307;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let circles = bus.get_port::<Circles>(CIRCLES, Start::Now)?;
    let poses = bus.get_port::<HeadPose>(HEAD_POSE, Start::Now)?;
    let predictions = bus.put_port::<BallPredictions>(PREDICTION, Priority::High)?;
    let mut sight = Sight::new(settings)?;
    let mut times = Times::at(25);
    ready();
    while !stopped() {
        let got = circles.get(PATIENCE)?;
        while let Some(packet) = poses.try_get()? {
            packet.iter().for_each(|pose| sight.pose(pose));
        }
        let Some(pair) = got.and_then(|packet| sight.pair(packet.first()?)) else {
            continue;
        };
        let begun = now_ns();
        if let Some(seen) = sight.predict(&pair) {
            predictions.put_copy(&[seen])?;
        }
        times.push(now_ns() - begun);
    }
    Ok(RoleReport {
        lost: circles.lost(),
        ..times.report()
    })
}

/// Predicts balls from head poses and circles of both cameras, in any order of arrival.
#[derive(Debug)]
pub struct Sight {
    corrections: Corrections,
    tracker: BallTracker,
    poses: KnownPoses,
    newest: [Option<Circles>; 2],
}

impl Sight {
    /// Creates a tracker without measurements.
    ///
    /// # Errors
    /// A description or a calibration that cannot be read, or cameras without overlap.
    pub fn new(settings: &RoleSettings) -> Result<Self, RoleError> {
        let config = TrackConfig {
            clutter: settings.clutter,
            ..TrackConfig::default()
        };
        let corrections = settings.corrections()?;
        Ok(Self {
            tracker: BallTracker::new(corrections.robot().description(), config)?,
            corrections,
            poses: KnownPoses::new(),
            newest: [None; 2],
        })
    }

    /// Adds a head pose.
    pub fn pose(&mut self, pose: &HeadPose) {
        self.poses.take(pose);
    }

    /// Adds the circles of one picture in camera coordinates. Once both pictures of an exposure are there, returns
    /// their circles as the cameras of the description would see them.
    pub fn pair(&mut self, seen: &Circles) -> Option<[Circles; 2]> {
        *self.newest.get_mut(seen.camera as usize)? = Some(self.corrections.circles(seen));
        let [Some(left), Some(right)] = self.newest else {
            return None;
        };
        (left.frame == right.frame).then(|| {
            self.newest = [None; 2];
            [left, right]
        })
    }

    /// Returns the predictions for a pair of pictures, or `None` if the head pose at that time is unknown.
    pub fn predict(&mut self, [left, right]: &[Circles; 2]) -> Option<BallPredictions> {
        let head = self.poses.at(left.exposure_ns)?;
        self.tracker.push([left, right], &head).ok()
    }
}

/// Recent head poses.
#[derive(Debug)]
struct KnownPoses {
    ring: PoseRing,
    last: Option<HeadPose>,
}

impl KnownPoses {
    fn new() -> Self {
        Self {
            ring: PoseRing::new(POSES),
            last: None,
        }
    }

    fn take(&mut self, pose: &HeadPose) {
        match &self.last {
            // The estimator restarted.
            Some(last) if pose.t_ns <= last.t_ns => self.ring.clear(),
            _ => {}
        }
        self.ring.put(*pose);
        self.last = Some(*pose);
    }

    fn at(&self, t_ns: u64) -> Option<HeadPose> {
        self.ring.at(t_ns).ok()
    }
}

/// Recent head poses from a channel.
pub(crate) struct Poses {
    port: GetPort<HeadPose>,
    known: KnownPoses,
}

impl Poses {
    pub fn open(bus: &Bus) -> Result<Self, RoleError> {
        Ok(Self {
            port: bus.get_port(HEAD_POSE, Start::Now)?,
            known: KnownPoses::new(),
        })
    }

    /// Takes all waiting packets.
    pub fn look(&mut self) -> Result<(), RoleError> {
        while let Some(packet) = self.port.try_get()? {
            packet.iter().for_each(|pose| self.known.take(pose));
        }
        Ok(())
    }

    /// Returns the pose at a time.
    pub fn at(&self, t_ns: u64) -> Option<HeadPose> {
        self.known.at(t_ns)
    }

    /// Returns the latest pose.
    pub fn last(&self) -> Option<&HeadPose> {
        self.known.last.as_ref()
    }
}
