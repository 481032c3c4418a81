//! Head pose from the inertial unit, and from kinematics while the robot waits.

use tactnet_catching::pose::{HeadEstimator, HeadInputs, TORSO_RESTS};
use tactnet_catching_packets::packets::CatchStatus;
use tactnet_channel::now_ns;

use crate::channels::{CATCH_STATE, HEAD_POSE, IMU, JOINT_STATE};
use crate::latest_value::{next, send};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let (samples, poses) = (IMU.get(bus)?, HEAD_POSE.put(bus)?);
    let (mut joints, mut status) = (JOINT_STATE.latest(bus)?, CATCH_STATE.latest(bus)?);
    let mut estimator = HeadEstimator::new(settings.corrections()?, TORSO_RESTS)?;
    let times = shell.repeat(512, |times| {
        let Some(sample) = next(&samples)? else {
            return Ok(());
        };
        let now = now_ns();
        let inputs = HeadInputs {
            sample: &sample,
            joints: joints.look()?,
            phase: status.look()?.and_then(CatchStatus::phase),
        };
        send(&poses, estimator.step(now, &inputs))?;
        times.push(now_ns() - now);
        Ok(())
    })?;
    Ok(times.report(samples.lost()))
}
