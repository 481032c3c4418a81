//! Head pose from the inertial unit, and from kinematics while the robot waits.

use tactnet_catching::pose::{PoseConfig, PoseEstimator};
use tactnet_catching_packets::JOINTS;
use tactnet_catching_packets::packets::{CatchPhase, CatchStatus, HeadPose, ImuSample, JointState};
use tactnet_channel::{Bus, Priority, Start, now_ns};

use crate::channels::{CATCH_STATE, HEAD_POSE, IMU, JOINT_STATE};
use crate::latest_value::{LatestValue, PATIENCE};
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Waiting time after which the oscillation of the torso springs is negligible, in ns.
const STILL_NS: u64 = 1_500_000_000;
/// Joint speed below which a joint counts as standing still, in rad/s and m/s.
const STILL_RATE: f64 = 0.02;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let corrections = settings.corrections()?;
    let robot = corrections.robot();
    let samples = bus.get_port::<ImuSample>(IMU, Start::Now)?;
    let mut joints = LatestValue::<JointState>::open(bus, JOINT_STATE)?;
    let mut status = LatestValue::<CatchStatus>::open(bus, CATCH_STATE)?;
    let poses = bus.put_port::<HeadPose>(HEAD_POSE, Priority::High)?;
    let mut estimator = PoseEstimator::new(robot.description(), PoseConfig::default())?;
    let mut times = Times::at(512);
    let mut stands_since: Option<u64> = None;
    let mut was_still = false;
    ready();
    while !stopped() {
        let Some(packet) = samples.get(PATIENCE)? else {
            continue;
        };
        joints.look()?;
        status.look()?;
        let Some(sample) = packet.first().map(|sample| corrections.sample(sample)) else {
            continue;
        };
        let now = now_ns();
        let stands = joints.get().is_some_and(|joints| is_still(&joints.dq));
        stands_since = stands_since.filter(|_| stands).or(stands.then_some(now));
        let waits = status.get().is_none_or(|status| {
            let phase = status.phase();
            matches!(phase, Some(CatchPhase::Armed | CatchPhase::Starting))
        });
        let still = waits && stands_since.is_some_and(|since| now - since > STILL_NS);
        if still && !was_still {
            // After a motion, the kinematic pose is more accurate than the integrated one, so the estimator restarts.
            estimator = PoseEstimator::new(robot.description(), PoseConfig::default())?;
        }
        was_still = still;
        let kinematic = joints.get().filter(|_| still).map(|joints| {
            let links = corrections.joints(joints).q;
            robot.chest(&links) * robot.head(&links)
        });
        // A rejected sample leaves the pose unchanged. Nothing is published before the first pose.
        if let Ok(pose) = estimator.push(&sample, kinematic) {
            poses.put_copy(&[pose])?;
        }
        times.push(now_ns() - now);
    }
    Ok(RoleReport {
        lost: samples.lost(),
        ..times.report()
    })
}

fn is_still(rates: &[f64; JOINTS]) -> bool {
    rates.iter().all(|rate| rate.abs() < STILL_RATE)
}
