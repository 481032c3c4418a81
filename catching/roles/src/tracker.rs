//! Tracker process: predicts balls from the circles of both cameras and the head pose.

use tactnet_catching::track::PairTracker;
use tactnet_channel::now_ns;

use crate::channels::{CIRCLES, HEAD_POSE, PREDICTION};
use crate::latest_value::{drain, next, send};
use crate::role::Shell;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings) = (shell.bus, &shell.settings);
    let (circles, poses) = (CIRCLES.get(bus)?, HEAD_POSE.get(bus)?);
    let predictions = PREDICTION.put(bus)?;
    let mut tracker = PairTracker::new(settings.corrections()?, settings.track())?;
    let times = shell.repeat(25, |times| {
        let seen = next(&circles)?;
        drain(&poses, |pose| tracker.pose(pose))?;
        let Some(pair) = seen.and_then(|seen| tracker.pair(&seen)) else {
            return Ok(());
        };
        let begun = now_ns();
        send(&predictions, tracker.predict(&pair))?;
        times.push(now_ns() - begun);
        Ok(())
    })?;
    Ok(times.report(circles.lost()))
}
