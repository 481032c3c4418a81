//! Slip watch: checks the calibration from markers and joint states.

use tactnet_catching::calibrate::MarkerWatch;
use tactnet_channel::{Wait, now_ns};

use crate::channels::{CALIBRATION_STATE, JOINT_STATE, MARKER_FEATURES};
use crate::latest_value::{at_most, send};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

/// Maximum sleep, short enough that no joint state is lost.
const LOOK: Wait = at_most(20);

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let kept = settings.kept()?.ok_or(RoleError::NoCalibration)?;
    let mut watch = MarkerWatch::new(&settings.robot()?, &kept, settings.slip)?;
    let mut features = MARKER_FEATURES.new_packets(bus)?;
    let mut joints = JOINT_STATE.new_packets(bus)?;
    let states = CALIBRATION_STATE.put(bus)?;
    let times = shell.repeat(25, |times| {
        let seen = features.wait(LOOK)?;
        let now = now_ns();
        let state = watch.step(now, seen, joints.look()?);
        times.push_since(now, !seen.is_empty());
        Ok(send(&states, state)?)
    })?;
    Ok(times.report(features.lost() + joints.lost()))
}
