//! Circles of both cameras and the head's pose in, predictions out.

use tactnet_catching::pose::PoseRing;
use tactnet_catching::track::{BallTracker, TrackConfig};
use tactnet_catching_packets::packets::{BallPredictions, Circles, HeadPose};
use tactnet_channel::{Bus, GetPort, Priority, Start, now_ns};

use crate::channels::{CIRCLES, HEAD_POSE, PREDICTION};
use crate::newest::PATIENCE;
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Poses that are kept: 0.6 s.
const POSES: usize = 307;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let robot = settings.robot()?;
    let circles = bus.get_port::<Circles>(CIRCLES, Start::Now)?;
    let mut poses = Poses::open(bus)?;
    let predictions = bus.put_port::<BallPredictions>(PREDICTION, Priority::High)?;
    let config = TrackConfig {
        clutter: settings.clutter,
        ..TrackConfig::default()
    };
    let mut tracker = BallTracker::new(robot.description(), config)?;
    let mut times = Times::at(25);
    let mut pair: [Option<Circles>; 2] = [None; 2];
    ready();
    while !stopped() {
        let got = circles.get(PATIENCE)?;
        poses.look()?;
        let Some(packet) = got else {
            continue;
        };
        let Some(seen) = packet.first().filter(|seen| seen.camera < 2) else {
            continue;
        };
        pair[seen.camera as usize] = Some(*seen);
        let [Some(left), Some(right)] = &pair else {
            continue;
        };
        if left.frame != right.frame {
            continue;
        }
        let begun = now_ns();
        // Pictures of a moment of which no pose is known say nothing.
        if let Some(head) = poses.at(left.exposure_ns)
            && let Ok(seen) = tracker.push([left, right], &head)
        {
            predictions.put_copy(&[seen])?;
        }
        times.push(now_ns() - begun);
        pair = [None; 2];
    }
    Ok(RoleReport {
        lost: circles.lost(),
        ..times.report()
    })
}

/// Where the head was in the last moments.
pub(crate) struct Poses {
    port: GetPort<HeadPose>,
    ring: PoseRing,
    last: Option<HeadPose>,
}

impl Poses {
    pub fn open(bus: &Bus) -> Result<Self, RoleError> {
        Ok(Self {
            port: bus.get_port(HEAD_POSE, Start::Now)?,
            ring: PoseRing::new(POSES),
            last: None,
        })
    }

    /// Takes what has come.
    pub fn look(&mut self) -> Result<(), RoleError> {
        while let Some(packet) = self.port.try_get()? {
            let Some(pose) = packet.first() else {
                continue;
            };
            match &self.last {
                // An estimator that began again.
                Some(last) if pose.t_ns <= last.t_ns => self.ring.clear(),
                _ => {}
            }
            self.ring.put(*pose);
            self.last = Some(*pose);
        }
        Ok(())
    }

    /// Returns where it was.
    pub fn at(&self, t_ns: u64) -> Option<HeadPose> {
        self.ring.at(t_ns).ok()
    }

    /// Returns where it was last.
    pub fn last(&self) -> Option<&HeadPose> {
        self.last.as_ref()
    }
}
