//! Tracker process: predicts balls from the circles of both cameras and the head pose.

use tactnet_catching::track::PairTracker;
use tactnet_channel::now_ns;

use crate::channels::{CIRCLES, HEAD_POSE, PREDICTION};
use crate::latest_value::{PATIENCE, drain};
use crate::role::Shell;
use crate::times::Times;
use crate::{RoleError, RoleReport};

pub(crate) fn run(shell: &Shell<'_>) -> Result<RoleReport, RoleError> {
    let (bus, settings, stopped) = (shell.bus, &shell.settings, shell.stopped);
    let (circles, poses) = (CIRCLES.get(bus)?, HEAD_POSE.get(bus)?);
    let predictions = PREDICTION.put(bus)?;
    let mut tracker = PairTracker::new(settings.corrections()?, settings.track())?;
    let mut times = Times::at(25);
    (shell.ready)();
    while !stopped() {
        let got = circles.get(PATIENCE)?;
        drain(&poses, |pose| tracker.pose(pose))?;
        let Some(pair) = got.and_then(|packet| tracker.pair(packet.first()?)) else {
            continue;
        };
        let begun = now_ns();
        if let Some(seen) = tracker.predict(&pair) {
            predictions.put_copy(&[seen])?;
        }
        times.push(now_ns() - begun);
    }
    Ok(times.report(circles.lost()))
}
