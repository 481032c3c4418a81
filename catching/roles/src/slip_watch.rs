//! Slip watch: checks the calibration from markers and joint states.
//!
//! ```text
//! marker/features, joint/state ─> slip-watch ─ calibration/state ─> user interface
//! ```

use std::time::Duration;

use tactnet_catching::calibrate::MarkerWatch;
use tactnet_catching_packets::packets::{CalibrationState, JointState, MarkerFeatures};
use tactnet_channel::{Bus, Priority, Start, Wait, now_ns};

use crate::channels::{CALIBRATION_STATE, JOINT_STATE, MARKER_FEATURES};
use crate::times::Times;
use crate::{RoleError, RoleReport, RoleSettings};

/// Maximum sleep, short enough that no joint state is lost.
const LOOK: Wait = Wait::Block {
    timeout: Duration::from_millis(20),
};
/// Period at which an unchanged result is published, in ns.
const TELL_NS: u64 = 500_000_000;

pub(crate) fn run(
    bus: &Bus,
    settings: &RoleSettings,
    ready: &dyn Fn(),
    stopped: &dyn Fn() -> bool,
) -> Result<RoleReport, RoleError> {
    let kept = settings.kept()?.ok_or(RoleError::NoCalibration)?;
    let mut watch = MarkerWatch::new(&settings.robot()?, &kept, settings.slip)?;
    let features = bus.get_port::<MarkerFeatures>(MARKER_FEATURES, Start::Now)?;
    let joints = bus.get_port::<JointState>(JOINT_STATE, Start::Now)?;
    let states = bus.put_port::<CalibrationState>(CALIBRATION_STATE, Priority::Normal)?;
    let mut times = Times::at(25);
    let mut told = (None, 0);
    ready();
    while !stopped() {
        let mut next = features.get(LOOK)?;
        let begun = now_ns();
        let seen = next.is_some();
        while let Some(packet) = next {
            packet.iter().for_each(|seen| watch.features(seen));
            next = features.try_get()?;
        }
        while let Some(packet) = joints.try_get()? {
            packet.iter().for_each(|state| watch.joints(state));
        }
        let now = now_ns();
        if seen {
            times.push(now - begun);
        }
        let state = watch.state(now);
        if told.0 != Some(state.hold) || now > told.1 + TELL_NS {
            told = (Some(state.hold), now);
            states.put_copy(&[state])?;
        }
    }
    Ok(RoleReport {
        lost: features.lost() + joints.lost(),
        ..times.report()
    })
}
