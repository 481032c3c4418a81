//! Head pose from the inertial unit, and from kinematics while the robot waits.

use tactnet_catching::pose::{HeadEstimator, HeadInputs};
use tactnet_catching_packets::packets::{CatchStatus, HeadPose, ImuSample, JointState};
use tactnet_channel::{Bus, Priority, Start, now_ns};

use crate::channels::{CATCH_STATE, HEAD_POSE, IMU, JOINT_STATE};
use crate::latest_value::{LatestValue, PATIENCE};
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Waiting time after which the oscillation of the torso springs is negligible, in s.
const STILL: f64 = 1.5;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let samples = bus.get_port::<ImuSample>(IMU, Start::Now)?;
    let mut joints = LatestValue::<JointState>::open(bus, JOINT_STATE)?;
    let mut status = LatestValue::<CatchStatus>::open(bus, CATCH_STATE)?;
    let poses = bus.put_port::<HeadPose>(HEAD_POSE, Priority::High)?;
    let mut estimator = HeadEstimator::new(settings.corrections()?, STILL)?;
    let mut times = Times::at(512);
    ready();
    while !stopped() {
        let Some(packet) = samples.get(PATIENCE)? else {
            continue;
        };
        joints.look()?;
        status.look()?;
        let Some(sample) = packet.first() else {
            continue;
        };
        let now = now_ns();
        let inputs = HeadInputs {
            sample,
            joints: joints.get(),
            phase: status.get().and_then(CatchStatus::phase),
        };
        if let Some(pose) = estimator.step(now, &inputs) {
            poses.put_copy(&[pose])?;
        }
        times.push(now_ns() - now);
    }
    Ok(RoleReport {
        lost: samples.lost(),
        ..times.report()
    })
}
