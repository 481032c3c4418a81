//! Head pose from the inertial unit, and from kinematics while the robot waits.

use tactnet_catching::pose::{HeadEstimator, HeadInputs, TORSO_RESTS};
use tactnet_catching_packets::packets::CatchStatus;
use tactnet_channel::now_ns;

use crate::channels::{CATCH_STATE, HEAD_POSE, IMU, JOINT_STATE};
use crate::latest_value::PATIENCE;
use crate::role::Shell;
use crate::times::Times;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings, stopped) = (shell.bus, &shell.settings, shell.stopped);
    let (samples, poses) = (IMU.get(bus)?, HEAD_POSE.put(bus)?);
    let (mut joints, mut status) = (JOINT_STATE.latest(bus)?, CATCH_STATE.latest(bus)?);
    let mut estimator = HeadEstimator::new(settings.corrections()?, TORSO_RESTS)?;
    let mut times = Times::at(512);
    (shell.ready)();
    while !stopped() {
        let Some(packet) = samples.get(PATIENCE)? else {
            continue;
        };
        let Some(sample) = packet.first() else {
            continue;
        };
        let now = now_ns();
        let inputs = HeadInputs {
            sample,
            joints: joints.look()?,
            phase: status.look()?.and_then(CatchStatus::phase),
        };
        if let Some(pose) = estimator.step(now, &inputs) {
            poses.put_copy(&[pose])?;
        }
        times.push(now_ns() - now);
    }
    Ok(times.report(samples.lost()))
}
